"""Pages of machines show the trends that a lake keeps, also of machines without a recording here.

usage: months.py PROBECELL-FLEET PROBECELL LAKE
"""

import json
import pathlib
import re
import subprocess
import sys
import tempfile
import urllib.error
import urllib.request


def main(fleet, probecell, lake):
    lake = pathlib.Path(lake)
    told = subprocess.run([fleet, "trends", "--named-in", "1", "--keep", "--lake", lake], capture_output=True, text=True)
    assert told.returncode == 0, told
    kept = json.loads((lake / "trends.json").read_text())
    assert kept["series"], kept
    with tempfile.TemporaryDirectory() as nothing:
        command = [probecell, "dashboard", "--listen", "127.0.0.1:0", "--lake", lake, "--recordings", nothing]
        dashboard = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        try:
            address = re.search(r"http://\S+", dashboard.stdout.readline())[0]
            read = lambda path: urllib.request.urlopen(address + path).read().decode()
            machines = {series["machine"] for series in kept["series"]}
            listed = read("machines")
            for machine in machines:
                assert f'href="/machine/{machine}"' in listed, (machine, listed)
                page = read(f"machine/{machine}")
                own = [series for series in kept["series"] if series["machine"] == machine]
                drawn = page.partition('id="months-title"')[2].partition("</section>")[0]
                assert drawn.count("<figure>") == len({(one["effect"], one["parameter"]) for one in own}), (machine, drawn)
                for series in own:
                    assert f"<code>{series['effect']}</code>" in drawn and f"Sizes in {len(series['days'])} days" in drawn, (series, drawn)
            try:
                read("machine/nobody")
                raise AssertionError("a machine that nothing tells of has a page")
            except urllib.error.HTTPError as error:
                assert error.code == 404, error
        finally:
            dashboard.terminate()
            dashboard.wait()
    refused = subprocess.run([probecell, "dashboard", "--lake", "nowhere"], capture_output=True, text=True)
    assert refused.returncode == 2 and "there is no lake in nowhere" in refused.stderr, refused
    print(f"{len(kept['series'])} series of {len(machines)} machines are on their pages")


main(*sys.argv[1:])
