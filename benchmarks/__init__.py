"""Speed, side by side with today's alternatives in one run; figures are ratios, never asserted by a test."""
