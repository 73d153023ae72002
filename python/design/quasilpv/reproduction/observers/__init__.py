"""Observers with estimated premises: classes of nonlinearities with proved constants, and what they buy."""
