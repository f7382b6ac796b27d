"""Evaluation of depth against exact or measured distances."""
