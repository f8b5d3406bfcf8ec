"""Counts of what a client sent and received, and the latency of reports."""

import math
from dataclasses import dataclass, field
from typing import Dict, List

from .reports import KINDS

_BUCKETS = 192


def _bucket(us: int) -> int:
    if us < 8:
        return us
    exponent = us.bit_length() - 1
    return min((exponent - 2) * 8 + ((us >> (exponent - 3)) & 7), _BUCKETS - 1)


def _limit(bucket: int) -> int:
    """The first microsecond behind a bucket."""
    bucket += 1
    if bucket < 8:
        return bucket
    exponent = bucket // 8 + 2
    return (8 + bucket % 8) << (exponent - 3)


class LatencyHistogram:
    """Times from a report's stamp to its arrival, in buckets of at most 12.5 % width. The stamp is of the server's
    clock and the arrival of the client's, so the figures are true on one machine only."""

    def __init__(self) -> None:
        self.buckets: List[int] = [0] * _BUCKETS

    def add(self, seconds: float) -> None:
        """Counts one latency; a negative one (the clocks disagree) counts as 0."""
        self.buckets[_bucket(int(seconds * 1e6)) if seconds > 0 else 0] += 1

    @property
    def count(self) -> int:
        return sum(self.buckets)

    def quantile_us(self, q: float) -> float:
        """The quantile q (0 to 1), rounded up to the end of its bucket; 0 when empty."""
        left = max(1, math.ceil(q * self.count))
        for bucket, number in enumerate(self.buckets):
            left -= number
            if left <= 0 and number:
                return float(_limit(bucket))
        return 0.0


@dataclass
class ReportStatistics:
    """Counts for reports of one kind."""

    count: int = 0
    latency: LatencyHistogram = field(default_factory=LatencyHistogram)


@dataclass
class Statistics:
    """Counts since the client was constructed, over all its connections."""

    taken: float = 0.0  # time.monotonic() of this copy
    connections: int = 0
    messages_out: int = 0
    messages_in: int = 0
    messages_dropped: int = 0  # commands called while the connection was lost
    messages_damaged: int = 0  # reports that could not be decoded
    tcp_bytes_out: int = 0  # handed to the system
    tcp_bytes_in: int = 0
    udp_bytes_out: int = 0
    udp_bytes_in: int = 0
    reports: Dict[str, ReportStatistics] = field(default_factory=lambda: {kind: ReportStatistics() for kind in KINDS})

    def rate_per_second(self, kind: str, earlier: "Statistics") -> float:
        """Reports of one kind per second since an earlier copy; 0 when no time has passed."""
        seconds = self.taken - earlier.taken
        return (self.reports[kind].count - earlier.reports[kind].count) / seconds if seconds > 0 else 0.0
