from filter_scenarios import paper

__all__ = ["paper"]
