"""Recordings as the mcap library of Python reads them."""

import pathlib


def messages(bag):
    """Messages of a recording by the last part of their topic, in the order of the recording."""
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    found = {}
    for file in sorted(pathlib.Path(bag).glob("*.mcap")):
        with open(file, "rb") as stream:
            reader = make_reader(stream, decoder_factories=[DecoderFactory()])
            for _, channel, _, message in reader.iter_decoded_messages():
                found.setdefault(channel.topic.rsplit("/", 1)[1], []).append(message)
    return found
