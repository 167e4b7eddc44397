"""``python -m surefix``: the command line."""

from surefix.cli import main

if __name__ == "__main__":
    main()
