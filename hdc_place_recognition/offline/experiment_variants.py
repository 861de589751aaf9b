# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""
The variants of the vector that are compared, and what was tried outside the package.

:data:`VARIANTS` are settings of the package: `hdc_experiments vectors` measures them again. The
leads below need other code; a prototype measured them once on the same images (5 or 10 seeds, 25
displacements, n = (6, 6)). Effects are differences of AP on stromovka / planetarium / corridor /
fr1 desk / lip6. None is in the package.

====================================================  ==================================
lead                                                  effect, and why it was dropped
====================================================  ==================================
pooled vector (GeM of the network's head) projected   -.024/-.010/+.014/+.017/+.011: the
and bundled in, weight .3                             mean is equal, seasons lose
the same, weight .5                                   -.08 on stromovka
pooled by average or from block 10, its root          worse or equal
running mean and variance of local features           -.008/-.001/-.016/+.002/+.004
variance of whole vectors, of the whole set           +.017/-.005/+.039/-.016/+.021: not
                                                      causal, an upper bound
signed square root of the vector                      -.005/+.002/+.019/-.011/+.005
mean that fades out (EMA), or is frozen               -.05 to -.2 on lip6
mean of the query's own session, after 5 of the       +.062 on stromovka, R@1 .72 to .80;
database's                                            n_x = 8 reaches this without it
unit length again after standardising                 -.001/.000/-.018/-.002/+.003
standardising without unit lengths                    worse
rows, columns or blocks of the projection             within .006 of the Gaussian one
normalised, random signs
soft maximum or mean over displacements               below the maximum
penalty on displacements, or cells that leave the     no difference
image left out
====================================================  ==================================

Phasors with fractional binding were not tried: 25 displacements cost 5 ms as it is.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from hdc_place_recognition.params.table import Value

KEPT, DROPPED, DEFAULT = 'kept', 'dropped', 'default'


@dataclass(frozen=True)
class Variant:
    """
    One setting of the vector.

    :param name: short, for tables.
    :param changes: parameters that differ from the default.
    :param verdict: on what the name says: kept (as an option), dropped, or it is the default.
    :param why: the reason in a few words.
    """

    name: str
    changes: Mapping[str, Value]
    verdict: str
    why: str


_NOT_DISPLACED: Mapping[str, Value] = {'displacements_x': 1, 'displacements_y': 1}

VARIANTS = (
    Variant('default', {}, DEFAULT, 'over seasons R@1 above .78'),
    Variant('no displacements', _NOT_DISPLACED, DROPPED, 'every set gains by displacements'),
    Variant('5 x 1 displacements', {'displacements_y': 1}, DROPPED, 'hand-held cameras nod'),
    Variant('5 x 3 displacements', {'displacements_y': 3}, DROPPED, 'they nod by more than .1'),
    Variant(
        '3 x 3 displacements, step .1',
        {'displacements_x': 3, 'displacements_y': 3},
        DROPPED,
        'do not reach far enough',
    ),
    Variant(
        '3 x 3 displacements, step .2',
        {'displacements_x': 3, 'displacements_y': 3, 'displacement_step': 0.2},
        DROPPED,
        'too coarse for eighths of the width',
    ),
    Variant('7 x 5 displacements', {'displacements_x': 7}, KEPT, 'slight gain, 40 % more forms'),
    Variant(
        '9 x 9 displacements, step .05',
        {'displacements_x': 9, 'displacements_y': 9, 'displacement_step': 0.05},
        KEPT,
        'slight gain, three times the forms',
    ),
    Variant('n = (6, 6)', {'n_x': 6}, KEPT, 'equal mean, seasons lose'),
    Variant('n = (4, 6)', {'n_x': 4}, KEPT, "the paper's: corridor gains, seasons lose"),
    Variant('n = (6, 4)', {'n_x': 6, 'n_y': 4}, KEPT, 'desk gains, seasons lose'),
    Variant('n = (8, 4)', {'n_y': 4}, KEPT, 'desk gains, corridor loses'),
    Variant('n = (1, 1)', {'n_x': 1, 'n_y': 1}, DROPPED, 'positions count'),
    Variant('Gaussian projection', {'projection': 'gaussian'}, KEPT, "the paper's; no difference"),
    Variant('l2_center', {'preprocessing': 'l2_center'}, KEPT, "the paper's; slightly worse"),
    Variant('no centring', {'center_database': False}, DROPPED, 'what all images share remains'),
    Variant('d = 1024', {'dimensions': 1024}, KEPT, 'a quarter of the memory, clearly worse'),
    Variant('d = 2048', {'dimensions': 2048}, KEPT, 'half the memory, worse'),
    Variant('d = 8192', {'dimensions': 8192}, KEPT, 'slight gain, twice the memory'),
    Variant('image width 240', {'image_width': 240}, KEPT, 'faster, seasons lose'),
    Variant('image width 512', {'image_width': 512}, DROPPED, 'slower and no better'),
    Variant('image width 640', {'image_width': 640}, DROPPED, 'slower and worse'),
    Variant('sequences of 3', {'sequence_length': 3}, KEPT, 'same route at the same speed only'),
    Variant('sequences of 5', {'sequence_length': 5}, KEPT, 'same route at the same speed only'),
    Variant(
        'plain HDC of the paper',
        {
            **_NOT_DISPLACED,
            'n_x': 4,
            'n_y': 6,
            'preprocessing': 'l2_center',
            'projection': 'gaussian',
            'center_database': False,
        },
        DROPPED,
        'the base line',
    ),
)
