"""A lake handed over to S3 (the server of moto) and asked there: answers equal those of the folder.

usage: s3.py PROBECELL-FLEET LAKE SAMPLES
"""

import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import threading

import boto3

BUCKET = "hall"


def server(host="127.0.0.1"):
    """The server and its port, once it listens."""
    process = subprocess.Popen(
        [sys.executable, "-u", "-m", "moto.server", "-H", host, "-p", "0"], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    for line in process.stderr:
        if "Running on http://127.0.0.1:" in line:
            # It says every request, into a pipe that must not fill.
            threading.Thread(target=process.stderr.read, daemon=True).start()
            return process, int(line.rsplit(":", 1)[1])
    raise SystemExit("the server has ended")


def client_of(endpoint):
    """What others use to reach the server."""
    return boto3.client(
        "s3", endpoint_url=endpoint, region_name="us-east-1", aws_access_key_id="test", aws_secret_access_key="test"
    )


def main(program, lake, samples):
    process, port = server()
    try:
        check(program, pathlib.Path(lake), pathlib.Path(samples), f"http://127.0.0.1:{port}")
    finally:
        process.terminate()
        process.wait()


def check(program, lake, samples, endpoint):
    credentials = {"AWS_ACCESS_KEY_ID": "test", "AWS_SECRET_ACCESS_KEY": "test", "AWS_REGION": "us-east-1"}
    environment = os.environ | credentials | {"AWS_ENDPOINT": endpoint, "AWS_ALLOW_HTTP": "true"}
    client = client_of(endpoint)
    client.create_bucket(Bucket=BUCKET)
    url = f"s3://{BUCKET}/north/lake"

    def ran(*arguments, status=0):
        told = subprocess.run([program, *map(str, arguments)], capture_output=True, text=True, env=environment)
        assert told.returncode == status, (arguments, told)
        return told.stdout if status == 0 else told.stderr

    ask = lambda place, statement: json.loads(ran("sql", statement, "--lake", place, "--json"))
    refusal = ran("sql", "SELECT 1", "--lake", url, status=2)
    assert f"there is no lake in {url}" in refusal and refusal.count("\n") == 1, refusal

    # Handed over once; what is there is not sent again.
    files = len(list(lake.glob("*/*/*.parquet")))
    assert ran("lake", "push", url, "--lake", lake) == f"{files} files put, 0 there already, 0 removed\n"
    assert ran("lake", "push", url, "--lake", lake) == f"0 files put, {files} there already, 0 removed\n"
    held = client.list_objects_v2(Bucket=BUCKET, Prefix="north/lake/")["Contents"]
    assert sum(one["Key"].endswith(".parquet") for one in held) == files

    # Asked there as here, trends as well.
    statements = ["SELECT * FROM causes ORDER BY machine_type, effect", "SELECT * FROM capability ORDER BY machine, feature_id"]
    statements += [f"SELECT count(*) AS n FROM {name}" for name in ("sessions", "touches", "effects", "signals", "faults")]
    for statement in statements:
        assert ask(url, statement) == ask(lake, statement), statement
    assert json.loads(ran("trends", "--lake", url, "--json")) == json.loads(ran("trends", "--lake", lake, "--json"))

    # A recording there.
    client.upload_file(str(samples / "ball_check.mcap"), BUCKET, "bags/ball check.mcap")
    [there] = ask(lake, f"SELECT diagnose('s3://{BUCKET}/bags/ball%20check.mcap') AS d")
    [here] = ask(lake, f"SELECT diagnose('{samples / 'ball_check.mcap'}') AS d")
    assert there == here and here["d"]["effects"], there
    [gone] = ask(lake, f"SELECT diagnose('s3://{BUCKET}/bags/nothing.mcap') AS d")
    assert "there is no such object" in gone["d"]["refusal"], gone

    # A change of the lake follows; another lake is refused, and so is adding to the copy.
    with tempfile.TemporaryDirectory() as work:
        copy = pathlib.Path(work, "copy")
        shutil.copytree(lake, copy)
        ran("lake", "compact", "--lake", copy)
        left = len(list(copy.glob("*/*/*.parquet")))
        assert left < files, (left, files)
        told = ran("lake", "push", url, "--lake", copy)
        assert told.endswith(" removed\n") and not told.endswith(" 0 removed\n"), told
        held = client.list_objects_v2(Bucket=BUCKET, Prefix="north/lake/")["Contents"]
        assert sum(one["Key"].endswith(".parquet") for one in held) == left, told
        for statement in statements:
            assert ask(url, statement) == ask(lake, statement), statement
        other = pathlib.Path(work, "other")
        ran("lake", "add", samples / "punch.mcap", "--lake", other)
        assert "holds the copy of another lake" in ran("lake", "push", url, "--lake", other, status=2)
        assert "is a copy" in ran("lake", "add", samples / "punch.mcap", "--lake", url, status=2)

    # A cell follows its recordings without a network, hands them over when there is one, and once.
    with tempfile.TemporaryDirectory() as work:
        bags, own, place = pathlib.Path(work, "recordings"), pathlib.Path(work, "lake"), f"s3://{BUCKET}/edge"
        bags.mkdir()
        for name in ("punch", "guideway"):
            shutil.copy(samples / f"{name}.mcap", bags)
            os.utime(bags / f"{name}.mcap", (0, 0))
        follow = ("lake", "follow", bags, "--lake", own, "--push", place, "--once")
        reached, environment["AWS_ENDPOINT"] = endpoint, "http://127.0.0.1:9"
        assert "not handed over" in ran(*follow, status=3)
        environment["AWS_ENDPOINT"] = reached
        sessions = "SELECT bag FROM sessions ORDER BY bag"
        held = ask(own, sessions)
        assert len(held) == 2, held
        assert " files put, 0 there already" in ran(*follow)
        assert ask(place, sessions) == held
        assert ran(*follow) == "0 added, 2 known already, 0 not added\n"
    print(f"{files} files handed over to S3, asked there, compacted to {left}")


if __name__ == "__main__":
    main(*sys.argv[1:])
