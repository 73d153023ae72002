"""The laws at the acceleration level, the default among them: search, loop, witness, envelope."""
