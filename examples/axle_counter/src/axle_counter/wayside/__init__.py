"""The equipment: detection points and the evaluator."""
