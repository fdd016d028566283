"""``python -m clothsim``: the command line."""

from clothsim._cli import main

if __name__ == "__main__":
    raise SystemExit(main())
