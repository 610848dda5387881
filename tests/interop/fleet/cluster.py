"""New diagnoses in a cluster, over S3 and mutual TLS, while an executor is killed: answers equal those of one process byte for byte.

usage: cluster.py PROBECELL-FLEET YEAR

YEAR is the example that makes a year. Runs as root in a network namespace of its own (`unshare -n`), where client, scheduler and S3
server are; the executors are on two further hosts (network namespaces), joined with this one and with one another by cables (veth).
"""

import contextlib
import datetime
import ipaddress
import json
import os
import pathlib
import queue
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading

from s3 import client_of, server

MACHINES, SESSIONS, PART, GROUPS = 4, 40, 4, 8
HERE, THERE = ("10.79.1.1", "10.79.2.1"), ("10.79.1.2", "10.79.2.2")
SCHEDULER, EXECUTOR = 50050, 50051
BUCKET = "year"
JOB = re.compile(r"job (\S+) stage")
ROWS = "SELECT * FROM diagnoses ORDER BY machine, \"month\", bag"


def ip(*words):
    subprocess.run(["ip", *words], check=True)


class Host:
    """Another computer: a network of its own."""

    def __init__(self, ending):
        self.holder = subprocess.Popen(["unshare", "-n", "sh", "-c", "echo there; exec cat"], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        ending.callback(self.holder.wait)
        ending.callback(self.holder.kill)
        assert self.holder.stdout.readline() == b"there\n"
        self.pid = str(self.holder.pid)
        self.inside = ["nsenter", "-t", self.pid, "-n", "--"]

    def ip(self, *words):
        subprocess.run([*self.inside, "ip", *words], check=True)


def cables(hosts):
    """Each host with this one, and the hosts with one another."""
    ip("link", "set", "lo", "up")
    for number, (host, here, there) in enumerate(zip(hosts, HERE, THERE)):
        host.ip("link", "set", "lo", "up")
        ip("link", "add", f"to{number}", "type", "veth", "peer", "name", "cable", "netns", host.pid)
        ip("address", "add", f"{here}/24", "dev", f"to{number}")
        ip("link", "set", f"to{number}", "up")
        host.ip("address", "add", f"{there}/24", "dev", "cable")
        host.ip("link", "set", "cable", "up")
    one, two = hosts
    one.ip("link", "add", "across", "type", "veth", "peer", "name", "across", "netns", two.pid)
    for host, own, other in ((one, *THERE), (two, *reversed(THERE))):
        host.ip("link", "set", "across", "up")
    for host, own, other in ((one, *THERE), (two, *reversed(THERE))):
        host.ip("route", "add", f"{other}/32", "dev", "across", "src", own)


class Authority:
    """Signs certificates for addresses."""

    def __init__(self, folder):
        from cryptography import x509
        from cryptography.hazmat.primitives import hashes, serialization
        from cryptography.hazmat.primitives.asymmetric import ec

        self.folder, self.x509, self.hashes, self.serialization, self.ec = folder, x509, hashes, serialization, ec
        folder.mkdir()
        self.key, self.certificate = None, None
        self.key, self.certificate = self.signed("ca", [])

    def signed(self, name, addresses):
        x509, now = self.x509, datetime.datetime.now(datetime.timezone.utc)
        key = self.ec.generate_private_key(self.ec.SECP256R1())
        subject = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, name)])
        issuer = self.certificate.subject if self.certificate else subject
        usage = [x509.ExtendedKeyUsageOID.SERVER_AUTH, x509.ExtendedKeyUsageOID.CLIENT_AUTH]
        made = (
            x509.CertificateBuilder().subject_name(subject).issuer_name(issuer).public_key(key.public_key())
            .serial_number(x509.random_serial_number()).not_valid_before(now - datetime.timedelta(hours=1))
            .not_valid_after(now + datetime.timedelta(days=1))
            .add_extension(x509.BasicConstraints(ca=self.certificate is None, path_length=None), critical=True)
        )
        if self.certificate:
            made = made.add_extension(x509.ExtendedKeyUsage(usage), critical=False)
        if addresses:
            names = [x509.IPAddress(ipaddress.ip_address(address)) for address in addresses]
            made = made.add_extension(x509.SubjectAlternativeName(names), critical=False)
        certificate = made.sign(self.key or key, self.hashes.SHA256())
        pem = self.serialization.Encoding.PEM
        form = (pem, self.serialization.PrivateFormat.PKCS8, self.serialization.NoEncryption())
        (self.folder / f"{name}.pem").write_bytes(certificate.public_bytes(pem))
        (self.folder / f"{name}.key").write_bytes(key.private_bytes(*form))
        return key, certificate

    def options(self, name, addresses):
        self.signed(name, addresses)
        own = self.folder / name
        return ["--ca", self.folder / "ca.pem", "--certificate", f"{own}.pem", "--key", f"{own}.key"]


class Process:
    """A process of the cluster, with what it says on standard error."""

    def __init__(self, ending, *command, **options):
        self.process = subprocess.Popen([str(word) for word in command], stderr=subprocess.PIPE, text=True, **options)
        self.said, self.lines = queue.SimpleQueue(), []
        threading.Thread(target=self.listen, daemon=True).start()
        ending.callback(self.end)

    def listen(self):
        for line in self.process.stderr:
            self.said.put(line)
        self.said.put(None)

    def until(self, pattern):
        """Waits until it says so."""
        while True:
            line = self.said.get(timeout=120)
            assert line is not None, f"ended without {pattern!r}: {self.lines}"
            self.lines.append(line)
            found = re.search(pattern, line)
            if found:
                return found

    def jobs(self):
        """Numbers of the jobs that it has told of."""
        with contextlib.suppress(queue.Empty):
            while True:
                self.lines.append(self.said.get_nowait())
        return {found[1] for found in map(JOB.match, self.lines) if found}

    def end(self, how=signal.SIGKILL):
        if self.process.poll() is None:
            self.process.send_signal(how)
        return self.process.wait()


def main(program, year):
    with contextlib.ExitStack() as ending:
        work = pathlib.Path(ending.enter_context(tempfile.TemporaryDirectory()))
        hosts = [Host(ending), Host(ending)]
        cables(hosts)
        subprocess.run([year, work / "year", str(MACHINES), str(SESSIONS)], check=True, stdout=subprocess.DEVNULL)
        moto, port = server("0.0.0.0")
        ending.callback(moto.wait)
        ending.callback(moto.terminate)
        upload(work, port)
        check(ending, program, work, hosts, port)


def upload(work, port):
    """The recordings to S3, each file under the name of its folder, and away from here."""
    client = client_of(f"http://127.0.0.1:{port}")
    client.create_bucket(Bucket=BUCKET)
    bags = work / "year" / "bags"
    files = {path.parent: path for path in bags.glob("*/*.mcap")}
    assert len(files) == MACHINES * SESSIONS
    for folder, path in files.items():
        client.upload_file(str(path), BUCKET, f"works{folder}")
    shutil.rmtree(bags)


def check(ending, program, work, hosts, port):
    authority = Authority(work / "certificates")
    own = authority.options("client", [])
    environment = lambda address: os.environ | {
        "AWS_ACCESS_KEY_ID": "test", "AWS_SECRET_ACCESS_KEY": "test", "AWS_REGION": "us-east-1",
        "AWS_ENDPOINT": f"http://{address}:{port}", "AWS_ALLOW_HTTP": "true",
    }
    place = f"{HERE[0]}:{SCHEDULER}"
    question = ["--lake", work / "year" / "lake", "--recordings", f"s3://{BUCKET}/works"]
    asked = lambda *more, binary=program: [str(word) for word in (binary, "diagnose", *question, "--sql", ROWS, "--json", *more)]
    cluster = ["--cluster", place, "--part", PART, "--check", 20, *own]

    def ran(*command, status=0):
        told = subprocess.run([str(word) for word in command], capture_output=True, env=environment("127.0.0.1"))
        assert told.returncode == status, (command, told)
        return told

    # In one process: a row for each session, and none is refused.
    alone = ran(*asked()).stdout
    rows = json.loads(alone)
    assert len(rows) == MACHINES * SESSIONS == len({row["bag"] for row in rows})
    assert all(row["diagnosis"]["verdict"] == row["verdict"] for row in rows) and any(row["diagnosis"]["effects"] for row in rows), rows[0]

    options = authority.options("scheduler", [*HERE, "127.0.0.1"])
    scheduler = Process(ending, program, "scheduler", "--listen", f"0.0.0.0:{SCHEDULER}", "--lost-after", 10, *options)
    scheduler.until("^scheduler on ")

    # Without an executor a question is given up.
    told = ran(*asked(*cluster, "--wait", 2), status=2).stderr.decode()
    assert "no executor has asked for work" in told and told.count("\n") == 1, told

    def executor(number, binary=program, options=None):
        here, there = HERE[number], THERE[number]
        options = options or authority.options(f"executor{number}", [there])
        command = [binary, "executor", "--scheduler", f"{here}:{SCHEDULER}", "--listen", f"{there}:{EXECUTOR}", *options]
        return Process(ending, *hosts[number].inside, *command, env=environment(here))

    executors = [executor(0), executor(1)]
    joined = {scheduler.until(r"^executor (\S+) has joined")[1] for _ in executors}
    assert joined == {f"{there}:{EXECUTOR}" for there in THERE}, joined

    def again(told):
        line = told.decode().splitlines()[-1]
        sessions, tasks, number, same = map(int, re.findall(r"\d+", line))
        assert sessions == len(rows) and same == len(rows) // 20 and tasks == len(rows) // PART + GROUPS, line
        return tasks, number

    # In the cluster, by both executors.
    told = ran(*asked(*cluster))
    assert told.stdout == alone
    tasks, number = again(told.stderr)
    assert number == 0, told
    told = ran(*asked("--where", "machine = 'nobody'", *cluster))
    assert json.loads(told.stdout) == [], told

    # Another build and a stranger are refused.
    other = work / "other"
    shutil.copy(program, other)
    with other.open("ab") as file:
        file.write(b"\n")
    for command in (asked(*cluster, binary=other), [*hosts[0].inside, other, "executor", "--scheduler", place, *own]):
        told = ran(*command, status=2).stderr.decode()
        assert "all of a cluster must be one build" in told and told.count("\n") == 1, told
    stranger = Authority(work / "strangers").options("stranger", [])
    told = ran(*asked("--cluster", place, *stranger), status=2).stderr.decode()
    assert place in told and "ertificate" in told and told.count("\n") == 1, told
    trusting = [*own[:2], *stranger[2:]]
    told = ran(*asked("--cluster", place, *trusting), status=2).stderr.decode()
    assert place in told and told.count("\n") == 1, told

    # An executor is killed when the first task is finished, by it.
    before = scheduler.jobs()
    assert before
    client = subprocess.Popen(asked(*cluster), stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment("127.0.0.1"))
    ending.callback(client.kill)
    job, killed = next(iter(before)), None
    while job in before:
        job, killed = scheduler.until(rf"^job (\S+) stage .* finished by (\S+):{EXECUTOR}$").groups()
    lost = THERE.index(killed)
    assert executors[lost].end() == -signal.SIGKILL
    out, told = client.communicate(timeout=300)
    assert client.returncode == 0, told
    assert out == alone
    tasks, number = again(told)
    assert 1 <= number < tasks // 2, told

    # What is left ends when it is asked to.
    assert executors[1 - lost].end(signal.SIGTERM) == 0, executors[1 - lost].lines
    print(f"{len(rows)} sessions in {tasks} tasks on two executors, one killed: {number} run again, answers as in one process")


if __name__ == "__main__":
    main(*sys.argv[1:])
