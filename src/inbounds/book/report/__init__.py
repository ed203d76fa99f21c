"""The study on a page: figures and tables from outcomes, one at a time for the chapters or all in one file."""
