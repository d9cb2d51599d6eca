#!/usr/bin/env python3
"""A bundle adjustment of a photo collection, in the format of "Bundle Adjustment in the Large": cameras in front of one
facade, so that most pairs of cameras share points and the reduced system is dense. What conjugate gradients are for.

    python3 benchmarks/make_bal.py --cameras 1000 --points 60000 --sightings 600 OUT
"""
import argparse
import math
import random


def rotate(w, x):
    """Rodrigues' formula: x turned by the rotation vector w [rad]."""
    angle = math.sqrt(sum(c * c for c in w)) or 1e-300
    k = [c / angle for c in w]
    cross = [k[1] * x[2] - k[2] * x[1], k[2] * x[0] - k[0] * x[2], k[0] * x[1] - k[1] * x[0]]
    dot = sum(a * b for a, b in zip(k, x))
    c, s = math.cos(angle), math.sin(angle)
    return [x[i] * c + cross[i] * s + k[i] * dot * (1 - c) for i in range(3)]


def project(camera, point):
    """Pixels of a point, None behind the camera or off the image: the camera looks along its -z."""
    p = [a + b for a, b in zip(rotate(camera[0:3], point), camera[3:6])]
    if p[2] > -1.0:
        return None
    x, y = -p[0] / p[2], -p[1] / p[2]
    if abs(x) > 0.6 or abs(y) > 0.45:
        return None
    r2 = x * x + y * y
    scale = camera[6] * (1 + camera[7] * r2 + camera[8] * r2 * r2)
    return scale * x, scale * y


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cameras", type=int, default=1000)
    parser.add_argument("--points", type=int, default=60000)
    parser.add_argument("--sightings", type=int, default=600, help="of each camera, at most")
    parser.add_argument("--noise", type=float, default=0.5, help="of pixels [px]")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("out")
    a = parser.parse_args()
    rng = random.Random(a.seed)

    # A facade of 100 m by 30 m, with relief; cameras 20 to 60 m before it.
    points = [[rng.uniform(-50, 50), rng.uniform(0, 30), rng.gauss(0, 1.5)] for _ in range(a.points)]
    points.sort()
    cameras, rows = [], []
    for i in range(a.cameras):
        center = [rng.uniform(-45, 45), rng.uniform(1, 15), rng.uniform(20, 60)]
        w = [rng.gauss(0, 0.05), rng.gauss(0, 0.25), rng.gauss(0, 0.03)]
        t = [-c for c in rotate(w, center)]
        camera = w + t + [rng.uniform(600, 900), rng.gauss(0, 0.02), rng.gauss(0, 0.005)]
        cameras.append(camera)
        seen = 0
        for j in rng.sample(range(a.points), min(a.points, 6 * a.sightings)):
            pixel = project(camera, points[j])
            if pixel is None:
                continue
            rows.append((i, j, pixel[0] + rng.gauss(0, a.noise), pixel[1] + rng.gauss(0, a.noise)))
            seen += 1
            if seen == a.sightings:
                break
    sightings = [0] * a.points
    for _, j, _, _ in rows:
        sightings[j] += 1
    number = {}
    for j in range(a.points):
        if sightings[j] >= 2:
            number[j] = len(number)
    rows = [r for r in rows if r[1] in number]
    with open(a.out, "w", encoding="ascii") as f:
        f.write(f"{a.cameras} {len(number)} {len(rows)}\n")
        for i, j, u, v in rows:
            f.write(f"{i} {number[j]} {u:.6f} {v:.6f}\n")
        for c in cameras:  # the start: off by what a first reconstruction is
            noise = [0.005] * 3 + [0.2] * 3 + [10.0, 0.01, 0.003]
            f.write("\n".join(repr(x + rng.gauss(0, s)) for x, s in zip(c, noise)) + "\n")
        for j in number:
            f.write("\n".join(repr(x + rng.gauss(0, 0.2)) for x in points[j]) + "\n")


if __name__ == "__main__":
    main()
