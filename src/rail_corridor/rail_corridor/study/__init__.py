"""Many runs of one question: a study file, the engine that runs it, what comes of it."""
