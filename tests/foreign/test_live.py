"""`run --live`: the results keep their bits, interventions can be repeated, attacks get nothing and change nothing."""

import http.client
import json
import re
import signal
import socket
import subprocess
import threading
import time
import tomllib
from contextlib import contextmanager
from urllib.parse import urlsplit

import pytest

from browser import CHROMIUM, browser
from conftest import ROOT

COMMAND = ROOT / "target" / "release" / "aso-ftc"
FMUS = ["--fmu", f"plant={ROOT}/dist/FrictionPendulum.fmu", "--fmu", f"controller={ROOT}/dist/AsoController.fmu"]
SET = '[[set]]\nvariable = "plant.F_c"\nvalue = 15\n'
LIMIT = 60  # s


class Live:
    """A run with a live view, seen from a client."""

    def __init__(self, process):
        self.process, self.said = process, []
        self.url = self.line(r"live view: (\S+)")[1]
        parts = urlsplit(self.url)
        self.port, self.root = parts.port, parts.path

    def line(self, pattern):
        """The match of the next line that fits."""
        for line in self.process.stdout:
            self.said.append(line)
            if match := re.search(pattern, line):
                return match
        raise AssertionError((self.said, self.process.stderr.read()))

    def ask(self, path, method="GET", body=None, root=None, **headers):
        """Status, headers and text of an answer."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=LIMIT)
        headers = {"Host": f"127.0.0.1:{self.port}"} | {name.replace("_", "-"): text for name, text in headers.items()}
        connection.request(method, (self.root if root is None else root) + path, body, headers)
        answer = connection.getresponse()
        text = answer.read().decode()
        connection.close()
        return answer.status, answer.headers, text

    def do(self, path, body="", status=200):
        """The sentence that answers a request of the page."""
        code, _, text = self.ask(path, "POST", body.encode(), Content_Type="application/toml")
        assert code == status, text
        return json.loads(text)["answer" if status < 400 else "error"]

    def state(self, query=""):
        """The state of the run."""
        status, _, text = self.ask(f"state?{query}")
        assert status == 200, text
        return json.loads(text)

    def until(self, holds):
        """Polls, as the page does, until the state fits."""
        end = time.monotonic() + LIMIT
        while not holds(state := self.state()):
            assert time.monotonic() < end, state
            time.sleep(0.01)
        return state

    def end(self, status=0):
        """Lets the run end; its output."""
        try:
            self.until(lambda state: state["outcome"])
        except (OSError, http.client.HTTPException):
            pass  # it has ended already
        out, self.errors = self.process.communicate(timeout=LIMIT)
        self.out = "".join(self.said) + out
        assert self.process.returncode == status, (self.out, self.errors)
        return self.out


@contextmanager
def live(out, *options, start="--live=paused", fmus=FMUS):
    """A run of the pendulum."""
    command = [COMMAND, "run", *fmus, *options, start, *(["--out", out] if out else [])]
    pipes: dict = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    process = subprocess.Popen(list(map(str, command)), cwd=ROOT, **pipes)
    try:
        yield Live(process)
    finally:
        process.kill()
        process.wait()


def repeated(out, aso_ftc):
    """The rows of the run, and those of its repetition."""
    done = aso_ftc("run", out / "live.toml")
    assert done.returncode == 0, done.stderr
    return (out / "results.csv").read_bytes(), (out / "repeat.csv").read_bytes()


def test_a_watched_run_keeps_its_bits(aso_ftc, tmp_path):
    options = ["--stop-time", 40, "--record-every", "step"]
    assert aso_ftc("run", *FMUS, "--out", tmp_path / "free", *options).returncode == 0
    with live(tmp_path / "seen", *options) as run:
        assert run.state()["phase"] == "paused"
        for name in ["", "page.css", "page.js", "plots.js", "facts"]:
            assert run.ask(name)[0] == 200
        run.do("continue")
        times = []
        while (state := run.state("show=2,3&rows=0"))["outcome"] is None:
            times = state["times"] or times
        out = run.end()
    assert state["time"] == 40 and "reached in 40000 steps" in state["outcome"] and "to repeat it" not in out
    assert times == sorted(set(times)) and not (tmp_path / "seen" / "live.toml").exists()
    assert (tmp_path / "seen" / "results.csv").read_bytes() == (tmp_path / "free" / "results.csv").read_bytes()


ALGORITHMS = {
    "gauss-seidel": [],
    "jacobi": ["--method", "jacobi"],
    "linear": ["--extrapolation", "linear", "--method", "jacobi"],
    "limited": ["--extrapolation", "limited"],
    "newton": ["--coupling", "newton"],
    "multirate": ["--every", "controller=7"],
    "isolated": ["--isolate"],
    "parquet": ["--format", "parquet"],
}
# @ stands for the time reached.
FAULTS = [
    '[[fault]]\nconnection = "controller.x_p"\nbias = { value = 0.001 }\n',
    '[[fault]]\nconnection = "controller.theta"\ndropout = { until = @0.01 }\n',
    '[[fault]]\nconnection = "controller.x_p"\nnoise = { deviation = 1e-5, seed = 3 }\n',
    '[[fault]]\nconnection = "plant.u"\nstuck = { until = @0.008 }\n[[set]]\nvariable = "plant.F_c"\nvalue = 9\nat = @0.1\n',
    '[[fault]]\nconnection = "controller.theta"\ndrift = { rate = 1e-4, from = @0.2 }\n',
    '[[fault]]\nconnection = "controller.x_p"\ndelay = { seconds = 0.0123 }\n',
]


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_a_run_with_interventions_is_repeated_bit_for_bit(aso_ftc, tmp_path, algorithm):
    options = ["--stop-time", 0.5, *(ALGORITHMS[algorithm] or ["--record-every", "step"])]
    with live(tmp_path, *options) as run:
        run.do("scenario", SET)
        steps = 0
        for number, fault in enumerate(FAULTS):
            for _ in range(3 + 2 * number):
                run.do("step")
                steps += 1
            reached = run.until(lambda state: state["phase"] == "paused" and state["steps"] == steps)["time"]
            text = re.sub(r"@(\S+)", lambda match: repr(reached + float(match[1])), fault)
            assert run.do("scenario", text).startswith("Accepted: it takes effect at t = ")
        assert len(run.until(lambda state: len(state["interventions"]) == 7)["interventions"]) == 7
        run.do("continue")
        out = run.end()
    assert re.search(r"to repeat it: \S+ run \S+/live.toml\n", out)
    kind = "parquet" if algorithm == "parquet" else "csv"
    done = aso_ftc("run", tmp_path / "live.toml")
    assert done.returncode == 0, done.stderr
    text = (tmp_path / "live.toml").read_text(encoding="utf-8")
    assert tomllib.loads(text)["scenario"]["set"][0]["value"] == 15 and "# At t = 0 s, to take effect at t = " in text
    results, again = ((tmp_path / f"{name}.{kind}").read_bytes() for name in ("results", "repeat"))
    assert results == again


def test_a_paced_run_that_is_changed_while_it_goes_on_is_repeated_bit_for_bit(aso_ftc, tmp_path):
    with live(tmp_path, "--stop-time", 100, "--record-every", "step", "--real-time=1", start="--live") as run:
        for fault in [SET, *FAULTS[:1], *FAULTS[2:3]]:
            before = run.state()["time"]
            run.until(lambda state: state["time"] > before)
            assert run.do("scenario", fault).startswith("Accepted: it takes effect at t = ")
        before = run.state()["time"]
        run.until(lambda state: state["time"] > before + 0.2)
        run.do("stop")
        run.end()
    text = (tmp_path / "live.toml").read_text(encoding="utf-8")
    (tmp_path / "live.toml").write_text(text.replace("stop-time = 100.0", "stop-time = 10.0"), encoding="utf-8")
    results, again = repeated(tmp_path, aso_ftc)
    assert again.startswith(results) and results.count(b"\n") > 200


def test_every_kind_of_fault_is_repeated_bit_for_bit(aso_ftc, tmp_path):
    kinds = [
        "bias = { value = 1e-4 }", "gain = { factor = 0.99 }", "drift = { rate = 1e-4 }", "stuck = { until = 0.06 }",
        "dropout = { until = 0.06 }", "dropout = { period = 0.01, lost = 0.002 }", "dropout = { probability = 0.1, seed = 4 }",
        "quantisation = { step = 1e-5 }", "saturation = { min = -0.2, max = 0.2 }", "noise = { amplitude = 1e-5, every = 0.003 }",
    ]
    with live(tmp_path, "--stop-time", 0.2, "--record-every", "step") as run:
        for number, kind in enumerate(kinds):
            run.do("step")
            name = ["controller.x_p", "controller.theta", "plant.u"][number % 3]
            run.do("scenario", f'[[fault]]\nconnection = "{name}"\n{kind}\n')
        # Of a Boolean input that is set, and of a Real input that is set.
        inversion = '[[fault]]\nconnection = "controller.compensate"\ninversion = {}\n'
        run.do("scenario", f'[[set]]\nvariable = "controller.compensate"\nvalue = false\n{inversion}')
        run.do("scenario", '[[set]]\nvariable = "plant.f_a"\nvalue = 0.5\n[[fault]]\nconnection = "plant.f_a"\ndropout = { from = 0.1 }\n')
        run.do("step")
        run.do("scenario", '[[set]]\nvariable = "plant.f_a"\nvalue = 0.25\nat = 0.05\n')
        assert len(run.until(lambda state: len(state["interventions"]) == 13)["interventions"]) == 13
        run.do("continue")
        run.end()
    results, again = repeated(tmp_path, aso_ftc)
    assert results == again and results.count(b"\n") == 202


def test_a_stopped_run_keeps_its_rows(aso_ftc, tmp_path):
    with live(tmp_path, "--stop-time", 3, "--record-every", "step") as run:
        run.do("scenario", SET)
        for _ in range(5):
            run.do("step")
        assert run.do("stop") == "The run is stopped at t = 0.005 s."
        out = run.end()
    assert "the run was stopped in the live view at t = 0.005 s" in out and not run.errors
    assert "# The run was stopped at t = 0.005 s" in (tmp_path / "live.toml").read_text(encoding="utf-8")
    results, again = repeated(tmp_path, aso_ftc)
    assert results.count(b"\n") == 7 and again.startswith(results) and again.count(b"\n") == 3002


def test_the_changes_of_an_earlier_run_are_replaced_with_a_line(aso_ftc, tmp_path):
    for lines in (0, 1):
        with live(tmp_path, "--stop-time", 0.1) as run:
            run.do("scenario", SET)
            run.do("scenario", FAULTS[2])
            run.do("stop")
            run.end()
        assert run.errors.count("live.toml: replaces the changes of an earlier run\n") == lines


def test_a_checkpoint_of_a_stopped_run_has_its_interventions(aso_ftc, tmp_path):
    saved = tmp_path / "run.state"
    with live(tmp_path, "--stop-time", 0.3, "--record-every", "step", "--checkpoint", saved) as run:
        run.do("scenario", SET + FAULTS[2] + FAULTS[0])
        run.do("step")
        run.do("step")
        run.do("scenario", '[[fault]]\nconnection = "plant.u"\nstuck = { until = 0.006 }\n')
        run.do("step")
        run.do("step")
        run.do("stop")
        run.end()
    assert aso_ftc("run", "--resume", saved).returncode == 0
    results, whole = repeated(tmp_path, aso_ftc)
    (rest,) = tmp_path.glob("results-from-*.csv")
    assert results + rest.read_bytes().split(b"\n", 1)[1] == whole


def test_a_pause_is_no_lateness_of_a_paced_run(tmp_path):
    with live(tmp_path, "--stop-time", 1000, "--step", 0.01, "--real-time=1") as run:
        time.sleep(0.2)
        run.do("continue")
        run.do("pause")
        time.sleep(2)
        run.do("continue")
        before = run.state()["time"]
        run.until(lambda state: state["time"] > before)
        run.do("stop")
        out = run.end()
    lateness = re.search(r"at most by (\S+) s", out)
    assert "of it paused by the live view" in out and (not lateness or float(lateness[1]) < 1.9), out


def test_ctrl_c_ends_a_paused_run(tmp_path):
    with live(tmp_path) as run:
        run.process.send_signal(signal.SIGINT)
        run.end(130)
    assert "the run was interrupted at t = 0 s" in run.errors


BAD = {
    "": "found no entry",
    "[[signal]]": 'found "signal", expected [[set]] or [[fault]]',
    "[[set": "intervention:1:",
    "\0": "intervention:1:",
    '[[set]]\nvariable = "plant.F_c"': "missing field `value`",
    '[[set]]\nvariable = "plant.F_d"\nvalue = 1': "scenario.set[1]: plant.F_d",
    '[[set]]\nvariable = "plant.F_c"\nvalue = true': "scenario.set[1]: plant.F_c = true: expected a finite number",
    '[[set]]\nvariable = "plant.F_c"\nvalue = nan': "scenario.set[1]: plant.F_c = NaN: expected a finite number",
    '[[set]]\nvariable = "plant.u"\nvalue = 1': "scenario.set[1]: plant.u is connected to controller.u",
    '[[set]]\nvariable = "plant.x_p"\nvalue = 1': "scenario.set[1]: plant.x_p is a continuous output, expected an input",
    '[[set]]\nvariable = "plant.F_c"\nvalue = 1\nat = 0': "at is 0, expected a time of 0.001 s or later",
    '[[fault]]\nconnection = "plant.u"\ndelay = { seconds = 0.01, from = 0.005 }':
        "from is 0.005, expected a time of 0.01 s or later, when the delayed values are known",
    '[[fault]]\nconnection = "plant.u"\ndelay = { seconds = "long" }': "invalid type",
    '[[fault]]\nconnection = "plant.u"\nbias = { value = 1, until = 0 }': "scenario.fault[1]: until is 0",
    '[[fault]]\nconnection = "plant.f_a"\nbias = { value = 1 }': "scenario.fault[1]: plant.f_a is an input without a source",
    '[[fault]]\nconnection = "plant.u"\nbias = { worth = 1 }': "unknown field `worth`",
    '[[fault]]\nconnection = "plant.u"\n': "scenario.fault[1]: found none, expected exactly one of bias",
}


def test_a_bad_intervention_is_one_sentence_and_changes_nothing(aso_ftc, tmp_path):
    options = ["--stop-time", 0.1, "--record-every", "step"]
    assert aso_ftc("run", *FMUS, "--out", tmp_path / "free", *options).returncode == 0
    with live(tmp_path / "seen", *options) as run:
        for text, expected in BAD.items():
            error = run.do("scenario", text, status=422)
            assert error.startswith(expected) and ("\n" not in error or "intervention:1:" in error), error
        assert run.state()["interventions"] == []
        run.do("continue")
        assert "to repeat it" not in run.end()
    assert (tmp_path / "seen" / "results.csv").read_bytes() == (tmp_path / "free" / "results.csv").read_bytes()


def test_at_the_end_no_change_is_possible(tmp_path):
    with live(tmp_path, "--stop-time", 0.001) as run:
        assert "the run ends before a change can take effect" in run.do("scenario", SET, status=422)
        run.do("continue")
        run.end()


def test_the_message_of_an_fmu_that_fails_comes_with_its_name(tmp_path):
    with live(tmp_path, "--stop-time", 10) as run:
        run.do("scenario", '[[fault]]\nconnection = "controller.theta"\nstuck = {}\n')
        run.do("continue")
        state = run.until(lambda state: state["outcome"])
        run.end(1)
    said = [message["text"] for message in state["messages"] if message["fmu"] == "plant"]
    assert state["counts"]["plant"] == len(said) > 0 and state["dropped"] == 0, state
    assert any("fmi2DoStep" in text for text in said), said
    assert "the run ended early" in state["outcome"] and "plant" in state["outcome"]


# Of steps that vary, rejected ones have touched times after the checkpoint.
VARYING = ["--step-control", "doubling", "--relative-tolerance", 1e-2]


def stopped_after(steps, out, options):
    """The checkpoint of a run with an intervention that is stopped after some steps."""
    saved = out / "run.state"
    with live(out, "--stop-time", 0.5, "--record-every", "step", "--checkpoint", saved, *options) as run:
        run.do("scenario", SET)
        for _ in range(steps):
            run.do("step")
        run.until(lambda state: state["phase"] == "paused" and state["steps"] == steps)
        run.do("stop")
        run.end()
    return saved


@pytest.mark.parametrize("options", [[], ["--every", "controller=7"], VARYING], ids=["fixed", "multirate", "varying"])
def test_a_resumed_run_with_interventions_is_repeated_bit_for_bit_from_its_start(aso_ftc, tmp_path, options):
    saved = stopped_after(25, tmp_path, options)
    first = (tmp_path / "live.toml").read_bytes()
    with live(None, fmus=["--resume", saved]) as run:
        facts = json.loads(run.ask("facts")[2])
        assert 0 < facts["start"] == run.state()["time"] < facts["stop"] == 0.5
        run.do("scenario", '[[set]]\nvariable = "plant.F_c"\nvalue = 9\n' + FAULTS[2])
        for _ in range(3):
            run.do("step")
        run.until(lambda state: state["phase"] == "paused" and state["steps"] == 3)
        run.do("scenario", FAULTS[0])
        run.do("continue")
        out = run.end()
    file = tmp_path / f"live-from-{facts['start']:.12g}.toml"
    assert re.search(rf"to repeat it: \S+ run \S+/{re.escape(file.name)}\n", out)
    assert (tmp_path / "live.toml").read_bytes() == first
    done = aso_ftc("run", file)
    assert done.returncode == 0, done.stderr
    results, rest = (path.read_bytes() for path in (tmp_path / "results.csv", *tmp_path.glob("results-from-*.csv")))
    assert results + rest.split(b"\n", 1)[1] == (tmp_path / "repeat.csv").read_bytes()


def test_a_delay_is_refused_where_steps_vary(tmp_path):
    with live(tmp_path, "--stop-time", 0.5, *VARYING) as run:
        error = run.do("scenario", '[[fault]]\nconnection = "plant.u"\ndelay = { seconds = 0.01 }', status=422)
        assert "where the steps vary" in error
        run.do("stop")
        run.end()


def test_a_resumed_run_that_is_watched_keeps_its_bits(aso_ftc, tmp_path):
    saved = stopped_after(25, tmp_path, [])
    free, watched = tmp_path / "free.csv", tmp_path / "seen.csv"
    options = ["--resume", saved, "--checkpoint", tmp_path / "other.state", "--results"]
    assert aso_ftc("run", *options, free).returncode == 0
    with live(None, watched, start="--live", fmus=options) as run:
        assert "to repeat it" not in run.end()
    assert watched.read_bytes() == free.read_bytes() and watched.read_bytes().count(b"\n") > 400


def test_an_unknown_start_of_the_live_view_is_refused(aso_ftc):
    done = aso_ftc("run", "--live=now", *FMUS)
    assert done.returncode == 2 and "running, paused" in done.stderr


# --- attacks


def test_nobody_without_the_token_gets_anything(tmp_path):
    with live(tmp_path) as run:
        token = run.root.strip("/")
        wrong = ["/", "//", "/state", f"/{token}", f"/{token[:-1]}/", f"/{token}0/", f"/{token.upper()}x/"]
        wrong += [f"/../{token}/", f"/%2e/{token}/", f"/x?{token}/"]
        for root in [*wrong, "/" + "0" * len(token) + "/"]:
            status, headers, text = run.ask("", root=root)
            assert status == 404 and token not in text and token not in str(headers), root
            assert run.ask("stop", "POST", b"", root=root, Content_Type="application/toml")[0] in (404, 405), root
        for name in ["../facts", "facts/", "page", "etc/passwd", "..", "state/"]:
            assert run.ask(name)[0] == 404, name
        assert run.state()["phase"] == "paused"
        run.do("stop")
        run.end()


def test_other_sites_and_names_are_refused_also_with_the_token(tmp_path):
    with live(tmp_path) as run:
        address = f"127.0.0.1:{run.port}"
        hosts = ["evil.example", f"evil.example:{run.port}", "127.0.0.1", f"127.0.0.1:{run.port + 1}", f"[::1]:{run.port}"]
        for host in [*hosts, f"{address}.evil.example", ""]:
            assert run.ask("facts", Host=host)[0] == 403, host
        for origin in [
            "null", "http://evil.example", f"https://{address}", f"http://{address}.evil.example", f"http://127.0.0.1:{run.port + 1}",
        ]:
            assert run.ask("facts", Origin=origin)[0] == 403, origin
            assert run.ask("stop", "POST", b"", Origin=origin, Content_Type="application/toml")[0] == 403, origin
        assert run.ask("stop", "POST", b"", Sec_Fetch_Site="cross-site", Content_Type="application/toml")[0] == 403
        assert run.ask("page.js", Sec_Fetch_Site="cross-site", Sec_Fetch_Mode="no-cors")[0] == 403
        # What a form of another site can send without asking.
        for kind in ["text/plain", "application/x-www-form-urlencoded", "multipart/form-data", ""]:
            assert run.ask("stop", "POST", b"", Content_Type=kind)[0] == 415, kind
        status, headers, _ = run.ask("facts", "OPTIONS", Origin="http://evil.example", Access_Control_Request_Method="POST")
        assert status == 403 and not [name for name in headers if name.lower().startswith("access-control")]
        assert run.ask("", Origin=f"http://localhost:{run.port}", Host=f"localhost:{run.port}")[0] == 200
        assert run.state()["phase"] == "paused"
        run.do("stop")
        run.end()


def test_addresses_have_one_method_and_the_page_may_load_nothing_from_outside(tmp_path):
    with live(tmp_path) as run:
        for name in ["pause", "continue", "step", "stop", "scenario"]:
            for method in ["GET", "PUT", "DELETE", "HEAD"]:
                assert run.ask(name, method)[0] == 405, (name, method)
        for name in ["", "facts", "state"]:
            assert run.ask(name, "POST", b"", Content_Type="application/toml")[0] == 405
        _, headers, page = run.ask("")
        assert "default-src 'none'" in headers["Content-Security-Policy"] and "unsafe" not in headers["Content-Security-Policy"]
        assert headers["X-Content-Type-Options"] == "nosniff" and headers["Cache-Control"] == "no-store"
        assert not re.search(r"https?://|style=|onclick|<script>", page)
        assert "http" not in run.ask("page.js")[2]
        for query in ["rows=x", "show=a", "rows=-1", "nothing"]:
            assert run.ask(f"state?{query}")[0] == 400, query
        run.do("stop")
        run.end()


def raw(port, data, wait=LIMIT):
    """The status that raw bytes get; 0 without an answer."""
    with socket.create_connection(("127.0.0.1", port), timeout=wait) as connection:
        try:
            connection.sendall(data)
            answer = connection.recv(4096)
        except (ConnectionError, TimeoutError):
            return 0
    return int(answer.split()[1]) if answer.startswith(b"HTTP/1.1 ") else 0


def test_requests_that_are_too_large_or_no_requests_are_refused(tmp_path):
    with live(tmp_path) as run:
        host = f"Host: 127.0.0.1:{run.port}\r\n".encode()
        post = b"POST " + run.root.encode() + b"scenario HTTP/1.1\r\n" + host + b"Content-Type: application/toml\r\n"
        cases = [
            (b"GET /" + b"a" * 100_000 + b" HTTP/1.1\r\n" + host + b"\r\n", {431, 0}),
            (b"GET / HTTP/1.1\r\n" + host + b"X: " + b"a" * 100_000 + b"\r\n\r\n", {431, 0}),
            (b"GET / HTTP/1.1\r\n" + host + b"X: y\r\n" * 200 + b"\r\n", {431}),
            (post + b"Content-Length: 1000000000000\r\n\r\n", {413}),
            (post + b"Content-Length: 99999999999999999999999999\r\n\r\n", {413}),
            (post + b"Content-Length: -1\r\n\r\n", {400}),
            (post + b"Content-Length: 1\r\nContent-Length: 2\r\n\r\nab", {400}),
            (post + b"Transfer-Encoding: chunked\r\n\r\n0\r\n\r\n", {411}),
            (post + b"Content-Length: 2\r\n\r\n\xff\xfe", {400}),
            (b"GET / HTTP/1.1\r\n\r\n", {403}),
            (b"GET / HTTP/1.1\r\n" + host + host + b"\r\n", {400}),
            (b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03", {400}),
            (b"\r\n\r\n\r\n nonsense\r\n\r\n", {400}),
            (b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n", {400}),
            (post + b"Content-Length: 65536\r\n\r\n" + b"a" * 10, {408}),
        ]
        for data, statuses in cases:
            assert raw(run.port, data) in statuses, data[:80]
        assert "intervention:" in run.do("scenario", "a" * 65_000, status=422)
        assert run.do("continue").startswith("The run goes on")
        run.end()


def test_floods_and_half_open_connections_change_no_bit_and_the_run_ends(aso_ftc, tmp_path):
    options = ["--stop-time", 100, "--record-every", 0.01]
    assert aso_ftc("run", *FMUS, "--out", tmp_path / "free", *options).returncode == 0
    with live(tmp_path / "seen", *options) as run:
        # Connections that send nothing, or a request that does not end.
        half = [socket.create_connection(("127.0.0.1", run.port)) for _ in range(200)]
        for number, connection in enumerate(half):
            try:
                connection.sendall(b"GET / HTTP/1.1\r\nHost: " if number % 2 else b"")
            except ConnectionError:
                pass
        over = threading.Event()

        def flood(data):
            while not over.is_set():
                try:
                    raw(run.port, data, 1)
                except OSError:
                    return

        host = f"Host: 127.0.0.1:{run.port}\r\n\r\n"
        asked = [f"GET {run.root}state HTTP/1.1\r\n{host}", f"GET /x/ HTTP/1.1\r\n{host}", "POST"]
        threads = [threading.Thread(target=flood, args=(data.encode(),)) for data in asked]
        for thread in threads:
            thread.start()
        # The server closes what has been open for too long, and answers again.
        end = time.monotonic() + LIMIT
        while True:
            try:
                run.do("continue")
                break
            except (OSError, http.client.HTTPException):
                assert time.monotonic() < end
        run.end()
        over.set()
        for thread in threads:
            thread.join()
        for connection in half:
            connection.close()
    assert (tmp_path / "seen" / "results.csv").read_bytes() == (tmp_path / "free" / "results.csv").read_bytes()


def test_the_server_listens_on_this_machine_only_and_its_tokens_differ(tmp_path):
    with live(tmp_path / "one") as one, live(tmp_path / "two") as two:
        assert one.root != two.root and len(one.root.strip("/")) == 48
        for run in (one, two):
            for family, address in ((socket.AF_INET, "127.0.0.2"), (socket.AF_INET6, "::1")):
                with socket.socket(family) as other, pytest.raises(OSError):
                    other.connect((address, run.port))


# --- the page


def two_fingers_zoom_until_a_double_tap(page):
    """All plots are zoomed by touch, and stay so while the run goes on."""
    first, last = "#figures .figure:first-child .u-over", "#figures .figure:last-child .u-over"
    page.until("Number(document.body.dataset.time) > 2")  # until then, the plots find their size
    page.evaluate(f"document.querySelector('{first}').scrollIntoView({{block: 'center'}})")

    def at_the_right(selector):
        """The time at the right edge of a plot."""
        shown = f"document.querySelector('{selector}').closest('.uplot').querySelector('.u-value').textContent"
        (x, y), (away, _) = page.places(selector, [0.999, -0.05])
        page.call("Input.dispatchMouseEvent", type="mouseMoved", x=away, y=y)
        page.until(f"Number.isNaN(Number({shown}))")
        page.call("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)
        page.until(f"Number.isFinite(Number({shown}))")
        return page.evaluate(f"Number({shown})")

    whole = at_the_right(first)
    page.pinch(first, (0.4, 0.5), (0.1, 0.9))
    zoomed = at_the_right(first)
    assert zoomed < 0.7 * whole
    page.until(f"Number(document.body.dataset.time) > {2 * whole}")
    assert at_the_right(first) == pytest.approx(zoomed, rel=0.1)
    page.evaluate(f"document.querySelector('{last}').scrollIntoView({{block: 'center'}})")
    assert at_the_right(last) == pytest.approx(zoomed, rel=0.1)
    page.double_tap(last)
    assert at_the_right(last) > 1.5 * whole


@pytest.mark.skipif(not CHROMIUM, reason="no Chromium is installed")
def test_the_page_shows_the_run_and_all_controls_work(aso_ftc, tmp_path):
    options = ["--stop-time", 600, "--real-time=2", "--record-every", "step"]
    with live(tmp_path / "run", *options) as run, browser(tmp_path / "profile") as page:
        page.open(run.url)
        page.until("document.body.dataset.ready === 'true' && document.body.dataset.phase === 'paused'")
        text = "document.getElementById('{}').textContent"
        assert page.evaluate(text.format("system")) == "plant, controller"
        click = "document.getElementById('{}').click()"
        page.evaluate(click.format("step"))
        page.until("document.body.dataset.time === '0.001'")
        page.evaluate(
            "document.getElementById('set-variable').value = 'plant.F_c';"
            "document.getElementById('set-variable').dispatchEvent(new Event('input'));"
        )
        page.until("document.getElementById('set-now').textContent === 'Present value: 25 N'")
        page.evaluate("document.getElementById('set-value').value = '12.5'; document.querySelector('#set button').click()")
        page.until("document.getElementById('interventions').childElementCount === 1")
        assert "takes effect at t = 0.002 s" in page.evaluate(text.format("answer"))
        page.evaluate(click.format("hold"))
        page.until("Number(document.body.dataset.time) > 0.5")
        page.evaluate(
            "document.getElementById('fault-input').value = 'controller.theta';"
            "document.getElementById('fault-kind').value = 'noise';"
            "document.getElementById('fault-kind').dispatchEvent(new Event('change'));"
            "document.getElementById('fault-deviation').value = '1e-5'; document.getElementById('fault-until').value = '59';"
            "document.querySelector('#fault button').click()"
        )
        page.until("document.getElementById('interventions').childElementCount === 2")
        page.evaluate("document.getElementById('fault-deviation').value = 'nonsense'; document.querySelector('#fault button').click()")
        page.until("document.getElementById('answer').classList.contains('failed')")
        page.evaluate(
            "document.getElementById('text').value = '[[set]]\\nvariable = \"controller.compensate\"\\nvalue = true';"
            "document.querySelector('#entries button').click()"
        )
        page.until("document.getElementById('interventions').childElementCount === 3")
        page.until("document.getElementById('set-now').textContent === 'Present value: 12.5 N'")
        names = "[...document.querySelectorAll('#signals input:checked')].map((box) => box.parentElement.dataset.name)"
        assert set(page.evaluate(names)) == {"plant.x_p", "plant.theta", "controller.u"}, "the outputs that are connected"
        page.evaluate("document.querySelector('[data-name=\"plant.f_fric\"] input').click()")
        page.until("document.querySelectorAll('#figures .uplot').length >= 2")
        page.until("document.getElementById('values').textContent.includes('plant.f_fric = ')")
        assert page.evaluate("document.querySelector('canvas').width") > 100
        two_fingers_zoom_until_a_double_tap(page)
        page.evaluate(click.format("hold"))
        page.until("document.body.dataset.phase === 'paused'")
        reached = page.evaluate("Number(document.body.dataset.time)")
        assert page.violations() == []
        page.evaluate(click.format("stop"))
        page.evaluate(click.format("stop"))
        page.until("document.body.dataset.phase === 'ended'")
        assert "stopped in the live view" in page.evaluate(text.format("status"))
        complaints = [text for text in page.complaints if "422" not in text]
        assert complaints == []
        assert all(request.startswith((run.url, "data:", "blob:")) for request in page.requests)
        run.end()
    changes = tmp_path / "run" / "live.toml"
    text = changes.read_text(encoding="utf-8")
    changes.write_text(text.replace("stop-time = 600.0", f"stop-time = {reached + 1}"), encoding="utf-8")
    results, again = repeated(tmp_path / "run", aso_ftc)
    assert again.startswith(results) and results.count(b"\n") > 500


@pytest.mark.skipif(not CHROMIUM, reason="no Chromium is installed")
def test_the_page_shows_times_in_seconds_since_1970_with_all_digits(tmp_path):
    with live(None, "--start-time", "1.7e9", "--stop-time", "1700000060") as run, browser(tmp_path / "profile") as page:
        page.open(run.url)
        page.until("document.body.dataset.ready === 'true' && document.body.dataset.phase === 'paused'")
        page.evaluate("document.getElementById('step').click()")
        page.until("document.getElementById('time').textContent === '1700000000.001 of 1700000060 s'")


class Tunnel:
    """A way to the page that can be broken and mended."""

    def __init__(self, target):
        self.target, self.listener = target, socket.create_server(("127.0.0.1", 0))
        self.port = self.listener.getsockname()[1]
        self.is_broken = False
        threading.Thread(target=self.accept, daemon=True).start()

    def accept(self):
        """Passes on one connection after the other, or closes it."""
        while True:
            try:
                here, _ = self.listener.accept()
            except OSError:
                return
            if self.is_broken:
                here.close()
                continue
            there = socket.create_connection(("127.0.0.1", self.target))
            for source, sink in ((here, there), (there, here)):
                threading.Thread(target=self.copy, args=(source, sink), daemon=True).start()

    def copy(self, source, sink):
        """Passes on bytes; `Host` and `Origin` get the port of the server."""
        try:
            while data := source.recv(65536):
                sink.sendall(data.replace(b":%d" % self.port, b":%d" % self.target))
            sink.shutdown(socket.SHUT_WR)
        except OSError:
            pass


@pytest.mark.skipif(not CHROMIUM, reason="no Chromium is installed")
def test_a_broken_tunnel_is_stated_and_the_page_goes_on_when_it_is_mended(tmp_path):
    with live(tmp_path / "run", "--stop-time", 1000, "--real-time=1", start="--live") as run, browser(tmp_path / "profile") as page:
        tunnel = Tunnel(run.port)
        page.open(f"http://127.0.0.1:{tunnel.port}{run.root}")
        page.until("Number(document.body.dataset.time) > 0.5")
        tunnel.is_broken = True
        page.until("!document.getElementById('lost').hidden")
        assert re.search(r"No answer since \d+:\d\d:\d\d", page.evaluate("document.getElementById('lost').textContent"))
        assert page.evaluate("document.getElementById('hold').disabled")
        before = page.evaluate("Number(document.body.dataset.time)")
        time.sleep(5)  # more than eleven questions, each 200 ms after the one before, took
        assert page.evaluate("Number(document.body.dataset.time)") == before
        tunnel.is_broken = False
        page.until(f"Number(document.body.dataset.time) > {before + 4}")
        assert page.evaluate("document.getElementById('lost').hidden && !document.getElementById('hold').disabled")
        page.evaluate("document.getElementById('hold').click()")
        page.until("document.body.dataset.phase === 'paused'")
