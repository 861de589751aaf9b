# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The package's one exception."""


class PlaceRecognitionError(ValueError):
    """
    Input, a parameter or a file that cannot be used.

    Its message is a single line for the user: the thing, its value and the remedy. Commands print
    that line and return exit code 2; the node warns and goes on with the next image.
    """

    def __init__(self, message: str) -> None:
        # Names from damaged files can hold line breaks.
        super().__init__(' '.join(message.splitlines()))
