# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
#
#   make demo         a loop driven twice through the real node, on a machine with Python only
#   make test         linters, type check and tests, likewise
#   make test-oldest  core and offline tests with the oldest libraries that a robot has

PYTHON ?= python3
VENV := .venv
OLDEST := .venv-oldest
OLDEST_PYTHON ?= python3.12

# A ROS 2 that is sourced is used; otherwise it comes from PyPI.
ifdef ROS_DISTRO
  VENV_OPTIONS := --system-site-packages
  EXTRAS := onnxruntime,plot
else
  EXTRAS := onnxruntime,plot,ros
  export AMENT_PREFIX_PATH := $(CURDIR)/$(VENV)
endif
# The demo and the tests talk to this machine only.
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
