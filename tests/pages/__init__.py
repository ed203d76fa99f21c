"""Tests of the built book in headless Chromium, some of them in Firefox (`make pages`)."""
