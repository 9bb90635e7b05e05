"""What the SCPI language promises, on both of its wires."""

from __future__ import annotations

import struct

import pytest
from clients import Scpi, take
from emulator import Emulator


@pytest.fixture(params=["scpi_tcp", "scpi_pty"])
def scpi(shared_emulator: Emulator, request):
    with Scpi(shared_emulator.endpoints[request.param]) as client:
        yield client


@pytest.mark.parametrize(
    "header",
    ["SENS:SWE:POIN", "SENSe:SWEep:POINts", "sens:swe:points", "SWE:POIN", ":sWeEp:pOiNt" + "s", "SENS:SWEEP:POIN"],
)
def test_headers_may_be_short_or_long_in_either_case_and_leave_out_options(scpi: Scpi, header):
    scpi.done(f"{header} 7000")
    assert scpi.ask(f"{header}?") == "7000"


@pytest.mark.parametrize("header", ["SENS:SWEE:POIN?", "SENS:POIN?", "POINTS?", "TRIG:LEVE?", "NOTHING", "*XYZ?"])
def test_anything_between_short_and_long_is_an_undefined_header(scpi: Scpi, header):
    scpi.send(header)
    assert scpi.ask("SYST:ERR?") == '-113,"Undefined header"'


@pytest.mark.parametrize(
    ("setting", "value", "reply"),
    [
        ("SENS:SWE:TINT", "2e-6", 2e-6),
        ("SENS:SWE:POIN", "1E4", 10000),
        ("SENS:SWE:OFFS:POIN", "-123", -123),
        ("TRIG:LEV", "-32768", -32768),
        ("TRIG:DEL", "0.25", 0.25),
        ("*ESE", "36", 36),
        ("*SRE", "32", 32),
    ],
)
def test_numbers_read_back_as_set(scpi: Scpi, setting, value, reply):
    scpi.done(f"{setting} {value}")
    assert float(scpi.ask(f"{setting}?")) == reply
    scpi.done("*ESE 0;*SRE 0")


@pytest.mark.parametrize(
    ("setting", "value", "reply"),
    [
        ("TRIG:SOUR", "IMMediate", "IMM"),
        ("TRIG:SOUR", "ext", "EXT"),
        ("TRIG:SLOP", "NEG", "NEG"),
        ("FORM:BORD", "SWAPped", "SWAP"),
        ("FORM", "INT,16", "INT,16"),
        ("FORMat:DATA", "INT,16", "INT,16"),
    ],
)
def test_words_read_back_in_their_short_form(scpi: Scpi, setting, value, reply):
    scpi.done(f"{setting} {value}")
    assert scpi.ask(f"{setting}?") == reply


@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("SENS:SWE:TINT 0.5e-6", -222),
        ("SENS:SWE:TINT 3e-6", -222),
        ("SENS:SWE:POIN 999", -222),
        ("SENS:SWE:POIN 1000001", -222),
        ("SENS:SWE:OFFS:POIN 1", -222),
        ("SENS:SWE:OFFS:POIN -5000", -222),
        ("TRIG:LEV 32768", -222),
        ("TRIG:DEL 1.1", -222),
        ("TRIG:LEV 1e99", -222),
        ("TRIG:SOUR SOMETIMES", -224),
        ("FORM REAL,32", -224),
        ("TRIG:LEV high", -104),
        ("TRIG:LEV nan", -104),
        ("TRIG:LEV", -109),
        ("TRIG:LEV 1,2", -108),
        ("*IDN? 1", -108),
        ("TRIG:LEV 1,,2", -102),
        ("TRIG::LEV 1", -102),
        ("5 TRIG", -102),
        ("\xe9\xe8", -102),
        ("TRAC:ACK 1", -109),
        ("TRAC:CRC? CH1,0,10", -230),
    ],
)
def test_what_cannot_be_done_is_queued_with_its_code_and_changes_nothing(scpi: Scpi, line, code):
    before = scpi.ask("TRAC:STAT?")
    scpi.send(line)
    assert scpi.error() == code
    assert scpi.error() == 0
    assert scpi.ask("TRAC:STAT?") == before


def test_fewer_points_than_the_pretrigger_wants_are_a_conflict(scpi: Scpi):
    scpi.done("SENS:SWE:OFFS:POIN -3000")
    scpi.send("SENS:SWE:POIN 2000")
    assert scpi.error() == -221
    assert scpi.ask("SENS:SWE:POIN?") == "5000"


@pytest.mark.parametrize("line", ["FETC?", "TRAC:DATA? CH1,0,10", "TRAC:DATA?", "TRAC:DATA? CH1,0,x"])
def test_a_query_for_data_that_cannot_be_answered_sends_the_empty_block(scpi: Scpi, line):
    assert scpi.block(line) == b""
    assert scpi.error() in (-230, -109, -104)


@pytest.mark.parametrize("span", ["CH1,0,5001", "CH1,5000,1", "CH1,-1,5", "CH1,0,0", "CH2,0,10", "CH1,0,500001"])
def test_a_span_outside_the_record_sends_the_empty_block(shared_emulator: Emulator, scpi: Scpi, span):
    take(shared_emulator, scpi)
    assert scpi.block(f"TRAC:DATA? {span}") == b""
    assert scpi.error() in (-222, -224)


def test_the_sentinel_tells_the_byte_order_of_the_data(shared_emulator: Emulator, scpi: Scpi):
    take(shared_emulator, scpi)
    spans = []
    for order, form in (("NORM", ">"), ("SWAP", "<")):
        scpi.done(f"FORM:BORD {order}")
        assert struct.unpack(form + "H", scpi.block("FORM:SENT?")) == (0x0102,)
        spans.append(struct.unpack(form + "100h", scpi.block("TRAC:DATA? CH1,450,100")))
    assert spans[0] == spans[1]


def test_one_line_carries_several_commands_and_its_replies_share_a_line(scpi: Scpi):
    assert scpi.ask("TRIG:LEV 321;SLOP NEG;LEV?;:SENS:SWE:POIN 2000;POIN?;*OPC?;TRIG:SLOP?") == "321;2000;1;NEG"
    assert scpi.error() == 0


def test_an_undefined_header_ends_its_line_an_unacceptable_value_does_not(scpi: Scpi):
    scpi.send("TRIG:LEV 99999;LEV 55;NONSENSE;LEV 66")
    assert [scpi.error(), scpi.error(), scpi.error()] == [-222, -113, 0]
    assert scpi.ask("TRIG:LEV?") == "55"


def test_the_event_register_tells_command_from_execution_errors(scpi: Scpi):
    scpi.ask("*ESR?")
    scpi.send("TRIG:LEV 99999")
    assert scpi.ask("*ESR?") == "16"
    scpi.send("NONSENSE")
    assert scpi.ask("*ESR?") == "32"
    scpi.send("*OPC")
    assert scpi.ask("*ESR?") == "1"
    assert scpi.ask("*ESR?") == "0"


def test_the_status_byte_sums_up_queue_and_events(scpi: Scpi):
    scpi.send("*CLS;*ESE 48;*SRE 36")
    assert scpi.ask("*STB?") == "0"
    scpi.send("NONSENSE")
    assert scpi.ask("*STB?") == str(4 + 32 + 64)
    scpi.send("*CLS")
    assert scpi.ask("*STB?") == "0"
    scpi.send("*ESE 0;*SRE 0")


def test_the_error_queue_takes_sixteen_and_then_says_so(scpi: Scpi):
    for _ in range(20):
        scpi.send("NONSENSE")
    errors = [scpi.error() for _ in range(17)]
    assert errors == [-113] * 15 + [-350, 0]


def test_an_endless_line_is_one_syntax_error_and_the_next_line_is_heard(scpi: Scpi):
    for _ in range(5):
        scpi.port.write(b"A" * 40_000)
    scpi.send("")
    assert scpi.ask("*OPC?") == "1"
    assert [scpi.error(), scpi.error()] == [-102, 0]


def test_carriage_return_and_empty_lines_are_ignored(scpi: Scpi):
    scpi.port.write(b"\r\n\n  ;; \n*IDN?\r\n")
    assert scpi.port.read_until(b"\n").count(b",") == 3
    assert scpi.error() == 0


def test_the_fixed_answers(scpi: Scpi):
    assert scpi.ask("SYST:VERS?") == "1999.0"
    assert scpi.ask("*TST?;*OPC?") == "0;1"
    assert scpi.ask("STAT:QUES:COND?") == "0"
    assert scpi.ask("TRAC:CAT?") == '"CH1"'
    assert scpi.ask("GATE:BEAM?;:INT:STAT?") == "1;15"
