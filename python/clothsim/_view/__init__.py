"""Looking at a run: pictures, films, a window, a page for the browser (``clothsim view``)."""
