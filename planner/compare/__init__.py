"""Sampling strategies compared on a pool of recordings: which needs fewer measurements?"""
