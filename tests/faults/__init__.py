"""Malformed inputs, made from code with kept seeds: each gives one sentence, or is read rightly."""
