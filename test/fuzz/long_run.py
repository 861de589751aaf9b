# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
A long fuzz run without hypothesis, which takes most of the time itself: random mutations.

    python test/fuzz/long_run.py [TARGET...] [--inputs 100000] [--seed 0]

prints a table; an input that raises another exception than PlaceRecognitionError, or takes more
than 2 s, is kept in the current folder and named.
"""

from __future__ import annotations

import argparse
import hashlib
from multiprocessing import get_context
import os
from pathlib import Path
import random
import resource
import shutil
import struct
import sys
import tempfile
from time import perf_counter
from types import SimpleNamespace as Fields

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parent.parent)]

from hdc_place_recognition.conversions.camera_info import camera_from_message  # noqa: E402
from hdc_place_recognition.conversions.image import (  # noqa: E402
    ImageConverter,
    SUPPORTED_ENCODINGS,
)
from hdc_place_recognition.datasets.folders import read_poses  # noqa: E402
from hdc_place_recognition.datasets.ground_truth import load_matrices  # noqa: E402
from hdc_place_recognition.errors import PlaceRecognitionError  # noqa: E402
from hdc_place_recognition.networks import cache, weights  # noqa: E402
from hdc_place_recognition.params.formats import load_yaml  # noqa: E402
import numpy as np  # noqa: E402
import test_fuzz_files as files  # noqa: E402
import test_fuzz_images as images  # noqa: E402

SLOWEST_S = 2.0
NUMBERS = [struct.pack(code, 2**bits - 1) for code, bits in (('<I', 31), ('>I', 31), ('<Q', 62))]
POSES = b'index,x,y,z,qx,qy,qz,qw\n0,1,2,3,0,0,0,1\n1,1.5,-2e3,0,0.1,0.2,0.3,0.9\n'
PARAMS = b'/**:\n  ros__parameters:\n    # A comment\n    n_x: 3\n    row_type: "float16"\n'
YAW = b'index,x,y,yaw\n0,1,2,3\n1,nan,2,3\n'
TOKENS = [part.encode('utf-8', 'replace') for part in files.YAML_PARTS]
TOKENS += [b'nan', b'1e999', b',', b'\n', b'"', b'-1', b'9' * 400]
SIZES = [0, 1, 2, 3, 4, 5, 7, 8, 16, 31, 2**16, 2**31 - 1, 2**32 - 1]


def mutated(rng: random.Random, seeds: list[bytes]) -> bytes:
    """Return a seed with some random changes."""
    data = bytearray(rng.choice(seeds))
    for _ in range(rng.choice((0, 1, 1, 2, 4, 8))):
        at, kind = rng.randrange(len(data) + 1), rng.randrange(7)
        if kind < 2 and at < len(data):
            data[at] = rng.randrange(256) if kind else data[at] ^ 1 << rng.randrange(8)
        elif kind == 2:
            data[at : at + 8] = rng.choice(NUMBERS)
        elif kind == 3:
            data[at:at] = rng.choice(TOKENS)
        elif kind == 4:
            del data[at : at + rng.randrange(64)]
        elif kind == 5:
            start = rng.randrange(len(data) + 1)
            data[at:at] = data[start : start + rng.randrange(64)]
        elif rng.random() < 0.3:
            del data[at:]
    return bytes(data)


class Runs:
    """The targets: from a random generator to a call with an input."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._images = images.samples()
        self._last = b''
        os.environ['XDG_CACHE_HOME'] = str(folder)
        (folder / 'hdc_place_recognition').mkdir()
        (folder / 'bag').mkdir()
        (folder / 'bag' / 'MCAP.mcap').write_bytes(files.BAGS['drive.mcap'])

    def raw_image(self, rng: random.Random) -> None:
        width, height = rng.choice(SIZES), rng.choice(SIZES)
        message = Fields(
            encoding=rng.choice(SUPPORTED_ENCODINGS),
            width=width,
            height=height,
            step=rng.choice([*SIZES, width * rng.randrange(20)]),
            is_bigendian=rng.randrange(2),
            data=rng.randbytes(rng.randrange(700)),
        )
        images.check_image(ImageConverter(images.MAX_PIXELS).convert(message))

    def compressed_image(self, rng: random.Random) -> None:
        message = Fields(format=rng.choice(images.FORMATS), data=mutated(rng, self._images))
        self._last = message.data
        converter = ImageConverter(images.MAX_PIXELS, oriented=rng.random() < 0.5)
        images.check_image(converter.convert(message))

    def camera_info(self, rng: random.Random) -> None:
        def numbers(count: int) -> list[float]:
            special = (np.nan, np.inf, 0.0, -1e300, 1e-300)
            return [
                rng.choice(special) if rng.random() < 0.03 else rng.gauss(0, 1)
                for _ in range(count)
            ]

        focal = abs(rng.gauss(0, 500))
        message = Fields(
            width=rng.choice([640, 640, *SIZES]),
            height=rng.choice([480, 480, *SIZES]),
            distortion_model=rng.choice(['plumb_bob', 'equidistant', 'rational_polynomial', 'x']),
            d=numbers(rng.randrange(16)),
            k=[focal, 0.0, 320.0, 0.0, focal, 240.0, 0.0, 0.0, 1.0]
            if rng.random() < 0.8
            else numbers(9),
            p=numbers(12),
            binning_x=rng.choice(SIZES),
            binning_y=rng.choice(SIZES),
            roi=Fields(x_offset=0, y_offset=0, width=rng.choice(SIZES), height=rng.choice(SIZES))
            if rng.random() < 0.3
            else Fields(x_offset=0, y_offset=0, width=0, height=0),
        )
        camera = camera_from_message(message, rectified=rng.random() < 0.2)
        camera.directions(np.array([[rng.random(), rng.random()]], np.float32))

    def params_yaml(self, rng: random.Random) -> None:
        load_yaml(self._file(mutated(rng, [PARAMS, PARAMS, *TOKENS])))

    def poses_csv(self, rng: random.Random) -> None:
        read_poses(self._file(mutated(rng, [POSES, YAW]))).view_directions('x')

    def ground_truth_npz(self, rng: random.Random) -> None:
        seeds = [files.ground_truth(False), files.ground_truth(True)]
        load_matrices(self._file(mutated(rng, seeds)), 3, 2)

    def bag(self, rng: random.Random) -> None:
        name = rng.choice([name for name in files.BAGS if name != 'metadata.yaml'])
        file = self._folder / name
        self._last = mutated(rng, [files.BAGS[name]])
        file.write_bytes(self._last)
        files.read_bag(file)

    def bag_metadata(self, rng: random.Random) -> None:
        content = mutated(rng, [files.BAGS['metadata.yaml']])
        self._last = content
        (self._folder / 'bag' / 'metadata.yaml').write_bytes(content)
        files.read_bag(self._folder / 'bag')

    def weights(self, rng: random.Random) -> None:
        weights.read_checked(self._file(mutated(rng, [files.LEGACY])), files.LEGACY_HASH)

    def cache(self, rng: random.Random) -> None:
        digest = hashlib.sha256(b'graph').hexdigest()
        path = self._folder / 'hdc_place_recognition' / f'net-{digest[:16]}.onnx'
        path.write_bytes(mutated(rng, [b'graph', b'another graph']))
        assert cache.cached('net', '.onnx', digest, lambda: b'graph') == b'graph'

    def _file(self, content: bytes) -> Path:
        self._last = content
        file = self._folder / 'input'
        file.write_bytes(content)
        return file

    def keep(self, name: str, number: int) -> str:
        """Keep the last input; return its path."""
        path = Path(f'fuzz_{name}_{number}')
        path.write_bytes(self._last)
        return str(path)


TARGETS = [name for name in vars(Runs) if not name.startswith('_') and name != 'keep']


def run(name: str, inputs: int, seed: int) -> str:
    """Run a target; return its row of the table."""
    rng = random.Random(f'{name} {seed}')
    memory = Path('/dev/shm')
    folder = tempfile.mkdtemp(dir=memory if memory.is_dir() else None)
    refused, slowest_s, crashes = 0, 0.0, []
    try:
        runs = Runs(Path(folder))
        call = getattr(runs, name)
        for number in range(inputs):
            start = perf_counter()
            try:
                call(rng)
            except PlaceRecognitionError as error:
                refused += 1
                if '\n' in str(error):
                    crashes.append(f'{runs.keep(name, number)}: several lines')
            except Exception as error:
                crashes.append(f'{runs.keep(name, number)}: {error!r}'[:200])
            took = perf_counter() - start
            slowest_s = max(slowest_s, took)
            if took > SLOWEST_S:
                crashes.append(f'{runs.keep(name, number)}: {took:.1f} s')
    finally:
        shutil.rmtree(folder)
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    row = (
        f'| {name} | {inputs} | {refused} | {len(crashes)} | {1000 * slowest_s:.0f} ms '
        f'| {peak_mb:.0f} MB |'
    )
    return '\n'.join([row, *crashes[:10]])


def main() -> None:
    """Run the targets, each in a process of its own."""
    parser = argparse.ArgumentParser(description='Fuzz run with random mutations.')
    parser.add_argument('targets', nargs='*', metavar='TARGET', help=', '.join(TARGETS))
    parser.add_argument('--inputs', type=int, default=100_000)
    parser.add_argument('--seed', type=int, default=0)
    arguments = parser.parse_args()
    print('| target | inputs | refused | crashes | slowest | peak memory |', flush=True)
    print('| --- | --- | --- | --- | --- | --- |', flush=True)
    for name in arguments.targets or TARGETS:
        with get_context('fork').Pool(1) as pool:
            print(pool.apply(run, (name, arguments.inputs, arguments.seed)), flush=True)


if __name__ == '__main__':
    main()
