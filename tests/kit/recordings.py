"""Recordings as the mcap library of Python reads them."""

import pathlib


def files(bag):
    """The file, or those of a folder in their order."""
    bag = pathlib.Path(bag)
    return [bag] if bag.is_file() else sorted(bag.glob("*.mcap"))


def raw(bag):
    """Channel and message of each message."""
    from mcap.reader import make_reader

    for file in files(bag):
        with open(file, "rb") as stream:
            for _, channel, message in make_reader(stream).iter_messages():
                yield channel, message


def decoded(bag, topics=None):
    """Channel, message and content of each message, of all topics or of these."""
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    for file in files(bag):
        with open(file, "rb") as stream:
            reader = make_reader(stream, decoder_factories=[DecoderFactory()])
            for _, channel, message, content in reader.iter_decoded_messages(topics=topics):
                yield channel, message, content


def messages(bag):
    """Contents by the last part of their topic, in the order of the recording."""
    found = {}
    for channel, _, content in decoded(bag):
        found.setdefault(channel.topic.rsplit("/", 1)[1], []).append(content)
    return found
