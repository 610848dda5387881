"""The touches of recordings as one Parquet file, by polars: touches_to_parquet.py OUT.parquet RECORDING..."""

import sys

import polars
import probecell


def main(out: str, paths: list[str]) -> None:
    """Reads the last measurement of each recording."""
    frames = []
    for path in paths:
        session = probecell.read_session(path)
        frames.append(session.touches().to_polars().with_columns(session=polars.lit(session.name)))
    polars.concat(frames, how="diagonal").write_parquet(out)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
