"""Files: range logs in."""

from locbounds.io.logs import AnchorColumns, LogColumns, RangeColumns, TruthColumns, read_log

__all__ = ["AnchorColumns", "LogColumns", "RangeColumns", "TruthColumns", "read_log"]
