# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
#
#   make demo         render a drive, play it through the node and check the closures
#   make test         run linters, type check and tests
#   make test-oldest  run the tests without ROS, with the oldest numpy and OpenCV of a robot

PYTHON ?= python3
VENV := .venv
OLDEST := .venv-oldest
OLDEST_PYTHON ?= python3.12

# Use a sourced ROS 2; otherwise install ROS 2 from PyPI.
ifdef ROS_DISTRO
  VENV_OPTIONS := --system-site-packages
  EXTRAS := onnxruntime,plot
else
  EXTRAS := onnxruntime,plot,ros
  export AMENT_PREFIX_PATH := $(CURDIR)/$(VENV)
endif
# Demo and tests communicate on this machine only.
export ROS_AUTOMATIC_DISCOVERY_RANGE := LOCALHOST
export ROS_DOMAIN_ID ?= 87

.PHONY: demo test test-oldest clean

demo: $(VENV)/demo-installed
	$(VENV)/bin/hdc_demo

test: $(VENV)/test-installed
	$(VENV)/bin/ruff check
	$(VENV)/bin/ruff format --check
	$(VENV)/bin/mypy
	$(VENV)/bin/python -m pytest

test-oldest: $(OLDEST)/installed
	$(OLDEST)/bin/python -m pytest

$(VENV)/bin/python:
	$(PYTHON) -m venv $(VENV_OPTIONS) $(VENV)

$(VENV)/demo-installed: setup.py | $(VENV)/bin/python
	$(VENV)/bin/pip install --quiet --editable '.[$(EXTRAS)]'
	touch $@

$(VENV)/test-installed: setup.py | $(VENV)/bin/python
	$(VENV)/bin/pip install --quiet --editable '.[$(EXTRAS),test,lint]'
	touch $@

$(OLDEST)/installed: setup.py
	$(OLDEST_PYTHON) -m venv $(OLDEST)
	$(OLDEST)/bin/pip install --quiet --editable '.[test]' \
	    'numpy==1.26.*' 'opencv-python-headless==4.6.*'
	touch $@

clean:
	rm -rf $(VENV) $(OLDEST) build install log *.egg-info
