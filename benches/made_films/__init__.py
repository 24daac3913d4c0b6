"""The parts of benches/made_films.py in the order of the work: tree, motion, surface, scenery, bad_input, picture, truth."""
