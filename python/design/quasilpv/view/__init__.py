"""The live view: a run as states over time, and the local web page that shows them."""
