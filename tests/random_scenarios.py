"""Random scenarios of every kind that the library bounds, few shapes: what is random are numbers, not structure.

Sizes reach from a street corner to a county, chains from sticky to alternating, starts and masks are any, noises from
precise to useless and from well separated to equal, so that linearised filters are sometimes close to their bound.
"""

import numpy as np

import locbounds as lb

STEPS = 8


class Draw:
    """Random numbers of one scenario, all lengths in units of its own size."""

    def __init__(self, seed, dim=2):
        self.rng = np.random.default_rng(seed)
        self.dim = dim
        self.size = 10 ** self.rng.uniform(1, 4)
        self.spread = self.size * 10 ** self.rng.uniform(-2.5, -0.8)  # of the prior position
        self.noise = self.spread * 10 ** self.rng.uniform(-0.7, 0.5)
        self.step_s = 10 ** self.rng.uniform(-1, 1)

    def within(self, low, high, shape=()):
        return np.exp(self.rng.uniform(np.log(low), np.log(high), shape))

    def place(self):
        return self.size * self.rng.uniform(-1, 1, self.dim)

    def mask(self):
        return self.rng.random(STEPS) < 0.9

    def uniform_times(self):
        return lb.Times.uniform(step_s=self.step_s, steps=STEPS)

    def irregular_times(self):
        return lb.Times(np.append(0.0, np.cumsum(self.step_s * self.rng.gamma(2.0, 0.5, STEPS) + 1e-3 * self.step_s)))

    def chain(self, modes=2):
        T = self.rng.dirichlet(np.full(modes, 0.7), modes)
        stay = self.rng.uniform(0, 1)
        return lb.MarkovSight(self.rng.dirichlet(np.ones(modes)), (1 - stay) * T + stay * np.eye(modes))

    def dwell(self):
        p = self.rng.uniform()
        return lb.DwellSight([p, 1 - p], self.step_s * self.within(0.3, 30, 2))

    def prior(self, derivatives=0):
        """Position and derivatives that move it by about its own spread within the whole time."""
        std = [self.spread]
        for order in range(1, derivatives + 1):
            std.append(self.spread / (self.step_s * STEPS * self.within(0.5, 2.0)) ** order)
        diagonal = np.repeat(std, self.dim)
        root = np.diag(diagonal) @ (np.eye(len(diagonal)) + 0.3 * self.rng.uniform(-1, 1, (len(diagonal),) * 2))
        return lb.GaussianPrior(np.append(self.place(), np.zeros(derivatives * self.dim)), root @ root.T)

    def gaussians(self, modes=2):
        """LOS around zero; every further mode later and wider, from hardly to far."""
        std = self.noise * np.append(1.0, np.cumprod(self.within(1.0, 4.0, modes - 1)))
        mean = self.noise * np.append(0.0, np.cumsum(self.within(0.1, 20.0, modes - 1)))
        return [lb.Gaussian(m, s) for m, s in zip(mean, std, strict=True)]


def nearly_constant_velocity(seed):
    """Known to the library's filters: Gaussian noises, one chain per link, gaps."""
    d = Draw(seed)
    links = [lb.Link(f"a{m}", lb.Range(d.place()), d.chain(), tuple(d.gaussians()), d.mask()) for m in range(3)]
    motion = lb.ConstantVelocity((d.spread * d.within(0.01, 1.0)) ** 2 / (d.step_s * STEPS) ** 3)
    return lb.Scenario("constant velocity", d.uniform_times(), motion, d.prior(1), links)


def accelerating(seed):
    """Constant acceleration, irregular times, Gaussian mixtures for NLOS."""
    d = Draw(seed)
    links = []
    for m in range(2):
        los, nlos = d.gaussians()
        late = lb.GaussianMixture([0.7, 0.3], [nlos.mean, nlos.mean + 2 * nlos.std], [nlos.std, 1.5 * nlos.std])
        links.append(lb.Link(f"a{m}", lb.Range(d.place()), d.dwell(), (los, late), d.mask()))
    motion = lb.ConstantAcceleration((d.spread * d.within(0.01, 1.0)) ** 2 / (d.step_s * STEPS) ** 5)
    return lb.Scenario("constant acceleration", d.irregular_times(), motion, d.prior(2), links)


def heavy_tails(seed):
    """A random walk in 3-D, irregular times, noises that are not Gaussian, one chain per link, gaps."""
    d = Draw(seed, dim=3)
    links = []
    for m in range(2):
        share = d.rng.uniform(0.05, 0.95)
        parts = lb.StudentT(d.within(1.5, 30.0), 0.0, d.noise), lb.Laplace(0.0, d.noise * d.within(0.5, 2.0))
        late = lb.ExponentiallyModifiedGaussian(d.noise * d.within(0.1, 10.0), d.noise, d.noise * d.within(0.3, 5.0))
        noises = lb.Mixture([share, 1 - share], parts), late
        links.append(lb.Link(f"a{m}", lb.Range(d.place()), d.dwell(), noises, d.mask()))
    motion = lb.RandomWalk((d.spread * d.within(0.03, 1.0, 3)) ** 2 / (d.step_s * STEPS), dim=3)
    return lb.Scenario("heavy tails", d.irregular_times(), motion, d.prior(), links)


def reflected(seed):
    """A coordinated turn; what is measured depends on the sight; irregular times, gaps."""
    d = Draw(seed)
    links = [
        lb.Link(
            f"a{m}", lb.BySight([lb.Range(d.place()), lb.Range(d.place())]), d.dwell(), tuple(d.gaussians()), d.mask()
        )
        for m in range(2)
    ]
    motion = lb.CoordinatedTurn(
        d.rng.uniform(-0.5, 0.5) / d.step_s, (d.spread * d.within(0.01, 1.0)) ** 2 / (d.step_s * STEPS) ** 3
    )
    return lb.Scenario("reflections in a turn", d.irregular_times(), motion, d.prior(1), links)


def common_door(seed):
    """A random walk in 2-D; links share a chain, noises are not Gaussian."""
    d = Draw(seed)
    sight = d.chain()
    t = lb.StudentT(d.within(1.5, 30.0), 0.0, d.noise), lb.Laplace(d.noise * d.within(0.1, 20.0), 2 * d.noise)
    late = lb.ExponentiallyModifiedGaussian(d.noise * d.within(0.1, 10.0), d.noise, d.noise * d.within(0.3, 5.0))
    links = [
        lb.Link(f"a{m}", lb.Range(d.place()), sight, noises, d.mask(), chain="door")
        for m, noises in enumerate([t, (lb.Gaussian(0.0, d.noise), late)])
    ]
    motion = lb.RandomWalk((d.spread * d.within(0.03, 1.0)) ** 2 / (d.step_s * STEPS))
    return lb.Scenario("common door", d.uniform_times(), motion, d.prior(), links)


def manoeuvring(seed):
    """Straight on, left or right; a chain that two links share."""
    d = Draw(seed)
    rates, q = d.rng.uniform(0.05, 0.5, 2) / d.step_s, (d.spread * d.within(0.1, 1.0)) ** 2 / (d.step_s * STEPS) ** 3
    turns = [lb.CoordinatedTurn(rate, q * d.within(0.3, 3.0)) for rate in (0.0, rates[0], -rates[1])]
    sight = d.chain()
    links = [
        lb.Link(f"a{m}", lb.Range(d.place()), sight, tuple(d.gaussians()), d.mask(), chain="door") for m in range(2)
    ]
    return lb.Scenario("manoeuvres", d.uniform_times(), lb.SwitchingMotion(turns, d.chain(3)), d.prior(1), links)


def calm_or_rough(seed):
    """Singular process noise in 3-D of three intensities, on the chain of one link; the other is reflected."""
    d = Draw(seed, dim=3)
    q = (d.spread * d.within(0.1, 1.0, 3)) ** 2 / (d.step_s**2 * STEPS) ** 2
    weather = d.chain(3)
    motion = lb.SwitchingMotion([lb.ConstantVelocity(q_r, dim=3, discrete=True) for q_r in q], weather, "weather")
    reflected = lb.BySight([lb.Range(d.place()), lb.Range(d.place())])
    links = [
        lb.Link("a0", lb.Range(d.place()), weather, tuple(d.gaussians(3)), d.mask(), chain="weather"),
        lb.Link("a1", reflected, d.chain(), tuple(d.gaussians()), d.mask()),
    ]
    return lb.Scenario("calm or rough", d.uniform_times(), motion, d.prior(1), links)
