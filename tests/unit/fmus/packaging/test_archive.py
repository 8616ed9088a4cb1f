"""Bad FMU files: each is one clear message, and nothing is left behind."""

import os
import stat
import zipfile
import zlib
from pathlib import Path

import pytest
from harness import warm

from vibroimpact.fmus.errors import ComponentFileError
from vibroimpact.fmus.packaging import archive, zip_members
from vibroimpact.fmus.packaging.archive import binary_path, platforms, unpack
from vibroimpact.fmus.packaging.fmpy_door import read_description
from vibroimpact.fmus.packaging.platform_names import binary_folder, library_suffix
from vibroimpact.fmus.safe_xml import LARGEST_XML

DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="M" instantiationToken="{t}">
  <CoSimulation modelIdentifier="M"/>
  <ModelVariables><Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>
  </ModelVariables><ModelStructure/>
</fmiModelDescription>
"""
BINARY = f"binaries/{binary_folder('3.0')}/M{library_suffix()}"
Members = dict[str | zipfile.ZipInfo, str | bytes]


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "cache"
    monkeypatch.setenv("VIBROIMPACT_CACHE", str(folder))
    return folder


def written(path: Path, members: Members | None = None, description: str | bytes = DESCRIPTION) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("modelDescription.xml", description)
        for name, content in (members or {BINARY: b"code"}).items():
            file.writestr(name, content)
    return path


def refusal(path: Path) -> str:
    with pytest.raises(ComponentFileError) as caught:
        unpack(path)
    message = str(caught.value)
    assert str(path) in message
    assert caught.value.exit_code == 2
    return message


def unpacked_folders(cache: Path) -> list[str]:
    return sorted(p.name for p in (cache / "fmus").glob("*")) if cache.exists() else []


def test_a_good_fmu_is_unpacked_once_and_found_again(tmp_path: Path, cache: Path) -> None:
    path = written(tmp_path / "M.fmu")
    first = unpack(path)
    assert binary_path(first).read_bytes() == b"code"
    before = binary_path(first).stat().st_mtime_ns
    assert unpack(path) == first
    assert binary_path(first).stat().st_mtime_ns == before
    assert unpacked_folders(cache) == [first.sha256]


def test_equal_contents_under_two_names_share_one_folder(tmp_path: Path) -> None:
    one = written(tmp_path / "one.fmu")
    other = tmp_path / "other.fmu"
    other.write_bytes(one.read_bytes())
    assert unpack(one).folder == unpack(other).folder


def test_a_cache_with_a_file_missing_is_repaired(tmp_path: Path) -> None:
    fmu = unpack(written(tmp_path / "M.fmu"))
    binary_path(fmu).unlink()
    assert binary_path(unpack(fmu.source)).read_bytes() == b"code"


def test_many_processes_may_unpack_the_same_fmu_at_once(tmp_path: Path, cache: Path) -> None:
    path = written(tmp_path / "M.fmu", {BINARY: b"x" * 3_000_000})
    code = (
        "import sys; from pathlib import Path; from vibroimpact.fmus.packaging.archive import *; "
        "assert binary_path(unpack(Path(sys.argv[1]))).stat().st_size == 3_000_000"
    )
    running = [warm.start(code, path, stdout=None, stderr=None) for _ in range(6)]
    assert [process.wait() for process in running] == [0] * 6
    assert len(unpacked_folders(cache)) == 1


def test_a_library_of_equal_size_in_the_cache_is_not_believed(tmp_path: Path) -> None:
    fmu = unpack(written(tmp_path / "M.fmu"))
    binary_path(fmu).write_bytes(b"evil")
    assert binary_path(unpack(fmu.source)).read_bytes() == b"code"


def test_another_process_does_not_believe_the_cache_either(tmp_path: Path) -> None:
    fmu = unpack(written(tmp_path / "M.fmu"))
    library = binary_path(fmu)
    before = library.stat()
    library.write_bytes(b"evil")
    os.utime(library, ns=(before.st_atime_ns, before.st_mtime_ns))
    code = (
        "import sys; from pathlib import Path; from vibroimpact.fmus.packaging.archive import binary_path, unpack\n"
        "assert binary_path(unpack(Path(sys.argv[1]))).read_bytes() == b'code'"
    )
    assert warm.run(code, fmu.source).returncode == 0


def test_a_link_in_the_place_of_a_library_is_not_followed(tmp_path: Path) -> None:
    fmu = unpack(written(tmp_path / "M.fmu"))
    (tmp_path / "elsewhere").write_bytes(b"code")
    library = binary_path(fmu)
    library.unlink()
    library.symlink_to(tmp_path / "elsewhere")
    assert not binary_path(unpack(fmu.source)).is_symlink()


def test_what_an_fmu_wrote_beside_its_own_files_stays(tmp_path: Path) -> None:
    fmu = unpack(written(tmp_path / "M.fmu"))
    (fmu.folder / "log.txt").write_text("written while it ran")
    assert (unpack(fmu.source).folder / "log.txt").exists()


def test_the_cache_is_the_users_alone(tmp_path: Path, cache: Path) -> None:
    fmu = unpack(written(tmp_path / "M.fmu"))
    modes = {path.stat().st_mode & 0o777 for path in (cache, cache / "fmus", fmu.folder)}
    assert modes == {0o700}


def test_a_cache_of_version_0_1_is_used_on_and_closed_to_others(tmp_path: Path, cache: Path) -> None:
    fmu = unpack(written(tmp_path / "M.fmu"))
    (cache / "fmus").chmod(0o755)
    before = binary_path(fmu).stat().st_ino
    assert binary_path(unpack(fmu.source)).stat().st_ino == before
    assert (cache / "fmus").stat().st_mode & 0o777 == 0o700


@pytest.mark.parametrize("place", ["", "fmus", "entry"])
def test_a_cache_that_others_may_write_is_refused(tmp_path: Path, cache: Path, place: str) -> None:
    fmu = unpack(written(tmp_path / "M.fmu"))
    folder = fmu.folder if place == "entry" else cache / place
    folder.chmod(0o777)
    message = refusal(fmu.source)
    assert f"{folder}: expected a folder that only you can write, got mode 0777" in message
    assert "VIBROIMPACT_CACHE" in message


@pytest.mark.skipif(
    not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root can give a folder away"
)
@pytest.mark.parametrize("place", ["", "fmus", "entry"])
def test_a_cache_of_another_user_is_refused(tmp_path: Path, cache: Path, place: str) -> None:
    fmu = unpack(written(tmp_path / "M.fmu"))
    folder = fmu.folder if place == "entry" else cache / place
    os.chown(folder, 65534, 65534)
    assert f"{folder}: expected a folder of your own, got one of user 65534" in refusal(fmu.source)


@pytest.mark.parametrize("place", ["fmus", "entry"])
def test_a_link_in_the_cache_is_refused(tmp_path: Path, cache: Path, place: str) -> None:
    fmu = unpack(written(tmp_path / "M.fmu"))
    folder = fmu.folder if place == "entry" else cache / "fmus"
    folder.rename(tmp_path / "elsewhere")
    folder.symlink_to(tmp_path / "elsewhere")
    assert "got a link" in refusal(fmu.source)


def test_the_default_cache_is_closed_to_others_whatever_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("VIBROIMPACT_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    (tmp_path / "vibroimpact" / "fmus").mkdir(parents=True)
    (tmp_path / "vibroimpact").chmod(0o775)
    (tmp_path / "vibroimpact" / "fmus").chmod(0o775)
    assert unpack(written(tmp_path / "M.fmu")).folder.parent == tmp_path / "vibroimpact" / "fmus"
    assert (tmp_path / "vibroimpact").stat().st_mode & 0o777 == 0o700


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    assert "No such file" in refusal(tmp_path / "absent.fmu")


@pytest.mark.parametrize("content", [b"", b"not a zip at all", b"PK\x03\x04 cut off"])
def test_a_file_that_is_no_zip_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "M.fmu"
    path.write_bytes(content)
    assert "expected an FMU (a zip archive)" in refusal(path)


def test_a_truncated_fmu_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path / "M.fmu")
    path.write_bytes(path.read_bytes()[:-30])
    assert "expected an FMU (a zip archive)" in refusal(path)


def test_a_damaged_member_is_refused_and_leaves_nothing(tmp_path: Path, cache: Path) -> None:
    path = tmp_path / "M.fmu"
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("modelDescription.xml", DESCRIPTION)
        file.writestr(BINARY, b"recognisable contents")
    path.write_bytes(path.read_bytes().replace(b"recognisable", b"unrecognised"))
    assert "damaged" in refusal(path)
    assert unpacked_folders(cache) == []


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("../outside.txt", "leads out"),
        ("resources/../../outside.txt", "leads out"),
        ("/outside.txt", "absolute"),
        ("C:/outside.txt", "absolute"),
        ("..\\outside.txt", "backslash"),
    ],
)
def test_a_member_that_would_land_outside_is_refused(
    tmp_path: Path, cache: Path, name: str, words: str
) -> None:
    assert words in refusal(written(tmp_path / "M.fmu", {name: b"x"}))
    assert not list(tmp_path.rglob("outside.txt"))
    assert unpacked_folders(cache) == []


def test_a_symbolic_link_is_refused(tmp_path: Path) -> None:
    link = zipfile.ZipInfo("resources/link")
    link.create_system = 3
    link.external_attr = (stat.S_IFLNK | 0o777) << 16
    assert "a link" in refusal(written(tmp_path / "M.fmu", {link: b"/etc/passwd"}))


@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_two_different_members_with_one_name_are_refused(tmp_path: Path) -> None:
    path = written(tmp_path / "M.fmu", {"modelDescription.xml": DESCRIPTION + " "})
    assert "the same name" in refusal(path)


@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_members_that_are_listed_twice_are_unpacked(tmp_path: Path) -> None:
    path = written(tmp_path / "M.fmu", {"extra/": b"", "extra/x/": b"", "extra/x/a": b"one"})
    with zipfile.ZipFile(path, "a") as file:
        for name in ("extra/", "extra/x/", "extra/x/a"):
            file.writestr(name, b"" if name.endswith("/") else b"one")
    assert (unpack(path).folder / "extra/x/a").read_bytes() == b"one"


@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_members_of_one_name_and_one_checksum_are_refused_when_their_bytes_differ(tmp_path: Path) -> None:
    one, other = b"plumless", b"buckeroo"  # CRC-32 of both: 4ddb0c25
    assert zlib.crc32(one) == zlib.crc32(other)
    path = written(tmp_path / "M.fmu", {"resources/x": one})
    with zipfile.ZipFile(path, "a") as file:
        file.writestr("resources/x", other)
    assert "an unpacked copy equal to the archive" in refusal(path)


@pytest.mark.parametrize("name", ["resources//x", "./resources/x", "resources/./x"])
def test_two_spellings_of_one_name_are_refused(tmp_path: Path, name: str) -> None:
    assert "the same name" in refusal(written(tmp_path / "M.fmu", {"resources/x": b"", name: b"later"}))


@pytest.mark.parametrize("names", [("resources/x", "resources/x/y"), ("resources/x/y", "resources/x")])
def test_a_file_where_others_need_a_folder_is_refused(tmp_path: Path, names: tuple[str, str]) -> None:
    assert "is a file and a folder" in refusal(written(tmp_path / "M.fmu", dict.fromkeys(names, b"")))


def test_a_description_that_is_a_folder_is_none(tmp_path: Path) -> None:
    path = tmp_path / "M.fmu"
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("modelDescription.xml/", b"")
        file.writestr(BINARY, b"code")
    assert "no modelDescription.xml" in refusal(path)


def test_members_of_great_depth_are_refused_at_once(tmp_path: Path) -> None:
    deep: Members = {f"{'a/' * 30_000}{number}": b"" for number in range(50)}
    assert "lies deeper than" in refusal(written(tmp_path / "M.fmu", deep))


def test_an_fmu_with_a_member_for_each_folder_is_unpacked(tmp_path: Path) -> None:
    members: Members = {"binaries/": b"", "resources/": b"", "./resources/x": b"1", BINARY: b"code"}
    assert (unpack(written(tmp_path / "M.fmu", members)).resources / "x").read_bytes() == b"1"


def test_a_member_without_a_name_is_refused(tmp_path: Path) -> None:
    nameless = zipfile.ZipInfo("x")
    nameless.filename = ""
    assert "has no name" in refusal(written(tmp_path / "M.fmu", {nameless: b""}))


@pytest.mark.parametrize(
    ("old", "new"), [('modelIdentifier="M"', f'modelIdentifier="{"x" * 400}"'), ("3.0", "9" * 5000)]
)
def test_texts_of_great_length_are_refused_in_short(tmp_path: Path, old: str, new: str) -> None:
    message = refusal(written(tmp_path / "M.fmu", description=DESCRIPTION.replace(old, new)))
    assert "modelDescription.xml" in message
    assert len(message) < 1000


def test_a_long_name_that_is_damaged_is_refused_in_short(tmp_path: Path) -> None:
    path = written(tmp_path / "M.fmu", {"resources/" + "x" * 5000: b"1"})
    path.write_bytes(path.read_bytes().replace(b"xxxx", b"xxxy", 1))
    message = refusal(path)
    assert "a damaged one: File name in directory" in message
    assert len(message) < 1000


def test_a_pipe_is_no_fmu(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "M.fmu")
    assert "a device" in refusal(tmp_path / "M.fmu")


def test_a_zip_bomb_is_refused_before_it_is_unpacked(tmp_path: Path, cache: Path) -> None:
    path = written(tmp_path / "M.fmu", {"resources/zeros": bytes(5_000_000)})
    assert path.stat().st_size < 50_000
    with pytest.raises(ComponentFileError, match="bytes when unpacked, limit 1000000"):
        unpack(path, limit=1_000_000)
    assert unpacked_folders(cache) == []


def test_a_zip_bomb_that_lies_about_its_size_is_not_expanded(tmp_path: Path, cache: Path) -> None:
    path = written(tmp_path / "M.fmu", {"resources/zeros": bytes(5_000_000)})
    size = (5_000_000).to_bytes(4, "little")
    path.write_bytes(path.read_bytes().replace(size, (10).to_bytes(4, "little")))
    assert "damaged" in refusal(path)
    assert unpacked_folders(cache) == []


def test_a_crowd_of_members_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(zip_members, "MEMBER_LIMIT", 3)
    assert "5 members, limit 3" in refusal(written(tmp_path / "M.fmu", {f"r/{k}": b"" for k in range(4)}))


BILLION_LAUGHS = """<?xml version="1.0"?>
<!DOCTYPE f [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;"><!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;">]>
<fmiModelDescription fmiVersion="3.0" modelName="&c;" instantiationToken="t"/>"""
EXTERNAL_ENTITY = """<?xml version="1.0"?>
<!DOCTYPE f [<!ENTITY secret SYSTEM "file:///etc/passwd">]>
<fmiModelDescription fmiVersion="3.0" modelName="m" instantiationToken="t">&secret;</fmiModelDescription>"""
EXTERNAL_TYPE = (
    """<?xml version="1.0"?><!DOCTYPE f SYSTEM "http://127.0.0.1:9/f.dtd"><fmiModelDescription/>"""
)


@pytest.mark.parametrize("text", [BILLION_LAUGHS, EXTERNAL_ENTITY, EXTERNAL_TYPE])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_xml_with_entities_is_refused_in_every_encoding(
    tmp_path: Path, cache: Path, text: str, encoding: str
) -> None:
    path = written(tmp_path / "M.fmu", description=text.encode(encoding))
    assert "without a document type" in refusal(path)
    with pytest.raises(ComponentFileError):
        read_description(path)
    assert unpacked_folders(cache) == []


def test_entities_in_the_build_description_are_refused_too(tmp_path: Path) -> None:
    path = written(tmp_path / "M.fmu", {"sources/buildDescription.xml": BILLION_LAUGHS})
    assert "sources/buildDescription.xml" in refusal(path)


def test_broken_xml_is_refused(tmp_path: Path) -> None:
    assert "well-formed" in refusal(written(tmp_path / "M.fmu", description="<fmiModelDescription>"))


@pytest.mark.parametrize(
    "description",
    [
        '<fmiModelDescription fmiVersion="1.0" guid="t"/>',
        DESCRIPTION.replace('instantiationToken="{t}"', ""),
        DESCRIPTION.replace('modelIdentifier="M"', 'modelIdentifier="../../M"'),
        DESCRIPTION.replace("CoSimulation", "Simulation"),
    ],
)
def test_a_description_without_version_token_or_identifier_is_refused(
    tmp_path: Path, description: str
) -> None:
    assert "modelDescription.xml" in refusal(written(tmp_path / "M.fmu", description=description))


def test_an_archive_without_a_description_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "M.fmu"
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("readme.txt", "not an FMU")
    assert "no modelDescription.xml" in refusal(path)


def test_an_fmu_for_another_platform_says_which_it_has(tmp_path: Path) -> None:
    fmu = unpack(
        written(tmp_path / "M.fmu", {"binaries/riscv64-plan9/M.so": b"", "binaries/sparc-sunos/M.so": b""})
    )
    assert platforms(fmu) == ("riscv64-plan9", "sparc-sunos")
    with pytest.raises(ComponentFileError, match="got riscv64-plan9, sparc-sunos") as caught:
        binary_path(fmu)
    assert BINARY in str(caught.value)
    assert str(fmu.source) in str(caught.value)


def test_fmi_2_platforms_have_their_own_names(tmp_path: Path) -> None:
    text = DESCRIPTION.replace('"3.0"', '"2.0"').replace("instantiationToken", "guid")
    name = f"binaries/{binary_folder('2.0')}/M{library_suffix()}"
    fmu = unpack(written(tmp_path / "M.fmu", {name: b"code"}, text))
    assert (fmu.fmi_version, fmu.token) == ("2.0", "{t}")
    assert binary_path(fmu).parent.name == binary_folder("2.0")


def test_a_cache_that_cannot_be_made_is_a_clear_message(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("a file, not a folder")
    monkeypatch.setenv("VIBROIMPACT_CACHE", str(blocked))
    with pytest.raises(ComponentFileError, match="VIBROIMPACT_CACHE"):
        unpack(written(tmp_path / "M.fmu"))


def test_what_a_killed_process_left_is_swept(
    tmp_path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    left = cache / "fmus" / ".unpacking-killed"
    left.mkdir(parents=True)
    monkeypatch.setattr(archive, "ABANDONED_AFTER", -1.0)
    fmu = unpack(written(tmp_path / "M.fmu"))
    assert unpacked_folders(cache) == [fmu.sha256]


@pytest.mark.parametrize("name", archive.PARSED_XML)
def test_a_description_above_16_mib_is_refused_before_a_parser_sees_it(
    tmp_path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """A comment of 300 MB in an archive of 300 kB took minutes: expat 2.5 is quadratic in the length of a token."""
    monkeypatch.setattr(archive, "root_of", None)
    content = DESCRIPTION.encode() + b"<!--" + b"a" * LARGEST_XML + b"-->"
    path = tmp_path / "M.fmu"
    if name == "modelDescription.xml":
        written(path, description=content)
    else:
        written(path, {BINARY: b"code", name: content})
    assert path.stat().st_size < 100_000
    assert f"{path}: {name}: expected XML of at most 16777216 bytes, got {len(content)}." in refusal(path)
    assert unpacked_folders(cache) == []
