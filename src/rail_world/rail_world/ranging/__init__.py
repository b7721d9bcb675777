"""Phase ranging between wayside and on-board stations."""
