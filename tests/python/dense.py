# SPDX-License-Identifier: BSD-3-Clause
"""Planar pose graphs in plain NumPy, as an oracle: nothing of cairn is used."""
import numpy as np


def wrap(angle):
    return np.arctan2(np.sin(angle), np.cos(angle))


def rotation(angle):
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def compose(a, b):
    return np.append(a[:2] + rotation(a[2]) @ b[:2], wrap(a[2] + b[2]))


def inverse(a):
    return np.append(-rotation(a[2]).T @ a[:2], -a[2])


def error(a, b, z):
    """(translation, angle) of z^-1 (a^-1 b)."""
    return compose(inverse(z), compose(inverse(a), b))


class PoseGraph:
    """Poses (n, 3), of which the first is fixed; edges (i, j, z, information)."""

    def __init__(self, poses, edges):
        self.poses = np.array(poses, dtype=float)
        self.edges = edges

    def chi2(self):
        total = 0.0
        for i, j, z, information in self.edges:
            e = error(self.poses[i], self.poses[j], z)
            total += e @ information @ e
        return total

    def normal_equations(self):
        """H and g of x y theta of all poses but the first, with Jacobians by central differences."""
        n = 3 * len(self.poses)
        H, g = np.zeros((n, n)), np.zeros(n)
        for i, j, z, information in self.edges:
            e = error(self.poses[i], self.poses[j], z)
            J = np.zeros((3, n))
            for pose in (i, j):
                for k in range(3):
                    step = np.zeros_like(self.poses)
                    step[pose, k] = 1e-6
                    after = error(*(self.poses + step)[[i, j]], z)
                    before = error(*(self.poses - step)[[i, j]], z)
                    J[:, 3 * pose + k] = (after - before) / 2e-6
            H += J.T @ information @ J
            g -= J.T @ information @ e
        return H[3:, 3:], g[3:]

    def optimize(self, iterations=10):
        for _ in range(iterations):
            H, g = self.normal_equations()
            self.poses[1:] += np.linalg.solve(H, g).reshape(-1, 3)
            self.poses[:, 2] = wrap(self.poses[:, 2])
        return self.chi2()

    def covariance(self, i, j):
        """Of the steps in the frames of the bodies: x_true = x exp(delta)."""
        sigma = np.linalg.inv(self.normal_equations()[0])

        def to_body(pose):
            A = np.eye(3)
            A[:2, :2] = rotation(self.poses[pose, 2]).T
            return A

        block = sigma[3 * i - 3 : 3 * i, 3 * j - 3 : 3 * j]
        return to_body(i) @ block @ to_body(j).T


def loop(seed=7, sides=12):
    """A noisy walk around a polygon, twice, with loop closures; information with correlations."""
    random = np.random.default_rng(seed)
    poses, edges = [np.zeros(3)], []
    step = np.array([1.0, 0.1, 2 * np.pi / sides])

    def noisy():
        root = random.normal(size=(3, 3)) * 2 + np.diag([8.0, 8.0, 15.0])
        information = root @ root.T
        noise = np.linalg.solve(np.linalg.cholesky(information).T, random.normal(size=3))
        return noise, information

    for k in range(1, 2 * sides + 1):
        noise, information = noisy()
        z = compose(step, noise)
        poses.append(compose(poses[-1], z))
        edges.append((k - 1, k, z, information))
        if k >= sides:
            noise, information = noisy()
            edges.append((k - sides, k, noise, information))
    return PoseGraph(poses, edges)
