"""Whom to cite, in words: the entries of docs/references.bib that the table of methods names."""

CITATIONS = {
    "bell1997": (
        'K. L. Bell, Y. Steinberg, Y. Ephraim and H. L. Van Trees, "Extended Ziv-Zakai lower bound for '
        'vector parameter estimation", IEEE Transactions on Information Theory, 1997'
    ),
    "chen2009": (
        'L. Chen and L. N. Wu, "Mobile positioning in mixed LOS/NLOS conditions using modified EKF banks and '
        'data fusion method", IEICE Transactions on Communications, 2009'
    ),
    "chen2009rbpf": (
        'L. Chen and L. N. Wu, "Mobile localization with NLOS mitigation using improved Rao-Blackwellized '
        'particle filtering algorithm", IEEE International Symposium on Consumer Electronics (ISCE), 2009'
    ),
    "chen2010": (
        'L. Chen, L. Wu and R. Piché, "Posterior Cramér-Rao lower bound for mobile tracking in mixed '
        'LOS/NLOS conditions", 17th European Signal Processing Conference (EUSIPCO), 2009'
    ),
    "fritsche2013": (
        'C. Fritsche, A. Klein and F. Gustafsson, "Bayesian Cramér-Rao bound for mobile terminal tracking in '
        'mixed LOS/NLOS environments", IEEE Wireless Communications Letters, 2013'
    ),
    "hajek1972": (
        'J. Hájek, "Local asymptotic minimax and admissibility in estimation", Proceedings of the Sixth '
        "Berkeley Symposium on Mathematical Statistics and Probability, 1972"
    ),
    "hernandez2005": (
        'M. L. Hernandez, B. Ristic and A. Farina, "A performance bound for manoeuvring target tracking '
        'using best-fitting Gaussian distributions", International Conference on Information Fusion, 2005'
    ),
    "ibragimov1981": (
        'I. A. Ibragimov and R. Z. Has\'minskii, "Statistical Estimation: Asymptotic Theory", Springer, 1981'
    ),
    "liao2006": (
        'J.-F. Liao and B.-S. Chen, "Robust mobile location estimator with NLOS mitigation using interacting '
        'multiple model algorithm", IEEE Transactions on Wireless Communications, 2006'
    ),
    "louis1982": 'T. A. Louis, "Finding the observed information matrix when using the EM algorithm", 1982',
    "mcguire2009": 'M. L. McGuire and K. N. Plataniotis, "Accuracy bounds for wireless localization methods", 2009',
    "qi2002": (
        'Y. Qi and H. Kobayashi, "Cramér-Rao lower bound for geolocation in non-line-of-sight environment", '
        "IEEE International Conference on Acoustics, Speech, and Signal Processing, 2002"
    ),
    "qi2006": (
        'Y. Qi, "Analysis of wireless geolocation in a non-line-of-sight environment", IEEE Transactions on '
        "Wireless Communications, 2006"
    ),
    "rapoport2004": (
        'I. Rapoport and Y. Oshman, "Recursive Weiss-Weinstein lower bounds for discrete-time nonlinear '
        'filtering", Proceedings of the 43rd IEEE Conference on Decision and Control, 2004'
    ),
    "rife1975": (
        'D. C. Rife, M. Goldstein and R. R. Boorstyn, "A unification of Cramér-Rao type bounds", IEEE '
        "Transactions on Information Theory, 1975"
    ),
    "stam1959": (
        'A. J. Stam, "Some inequalities satisfied by the quantities of information of Fisher and Shannon", '
        "Information and Control, 1959"
    ),
    "tichavsky1998": (
        'P. Tichavský, C. H. Muravchik and A. Nehorai, "Posterior Cramér-Rao bounds for discrete-time '
        'nonlinear filtering", IEEE Transactions on Signal Processing, 1998'
    ),
    "torrieri1984": (
        'D. J. Torrieri, "Statistical theory of passive location systems", IEEE Transactions on Aerospace '
        "and Electronic Systems, 1984"
    ),
    "weinstein1988": (
        'E. Weinstein and A. J. Weiss, "A general class of lower bounds in parameter estimation", IEEE '
        "Transactions on Information Theory, 1988"
    ),
    "weiss1985": (
        'A. J. Weiss and E. Weinstein, "A lower bound on the mean-square error in random parameter '
        'estimation", IEEE Transactions on Information Theory, 1985'
    ),
}
"""Citation key -> authors, title, where it appeared, year; as far as the bibliography knows them."""
