"""Reports as PDF, read by qpdf (pikepdf) and PDFium: whole, tagged, of the standards that they name, their pages drawn, their numbers
those of `measure`, and nobody's name in them unless asked."""

import io
import re

import numpy as np
import pikepdf
import pypdfium2

# Of what the reports state of themselves (PDF/A-3a, PDF/UA-1).
STANDARDS = {"pdfaid:part": "3", "pdfaid:conformance": "A", "pdfuaid:part": "1"}
# Pixels of a page that aren't its ground, at least; a page has a footer of about 0.1 %.
DRAWN = 0.003
SCALE = 0.5
# Whole rows of the tables of agreement: two masks, then these; a metric that the convention hasn't is unknown.
AGREEMENT = (
    ("dice", "jaccard", "volume_similarity", "relative_volume_difference", "sensitivity", "precision", "kappa"),
    ("hd_mm", "hd95_mm", "assd_mm", "masd_mm", "nsd"),
)
UNKNOWN = ("unknown", "unbekannt")
MINUS = "\N{MINUS SIGN}"


def strings(thing):
    """Every string of an object, unpacked streams included, but not of objects that it refers to: those are visited by themselves."""
    if isinstance(thing, (pikepdf.String, pikepdf.Name)):
        yield str(thing)
    if isinstance(thing, pikepdf.Array):
        inner = list(thing)
    elif isinstance(thing, (pikepdf.Dictionary, pikepdf.Stream)):
        inner = [one for _, one in thing.items()]
    else:
        return
    for one in inner:
        if isinstance(one, pikepdf.Object) and not one.is_indirect:
            yield from strings(one)
    if isinstance(thing, pikepdf.Stream):
        yield unpacked(thing).decode("latin-1")


def unpacked(stream):
    """Pixels of photographs stay as they are packed; there is no text in them."""
    try:
        return stream.read_bytes()
    except pikepdf.PdfError:
        return stream.read_raw_bytes()


def pages_text(document):
    return [" ".join(page.get_textpage().get_text_bounded().split()) for page in document]


def drawn(page):
    """Part of a page that isn't white."""
    return (page.render(scale=SCALE).to_numpy() < 250).any(axis=2).mean()


def bare(text):
    return "".join(text.split()).casefold()


def agrees(printed, value):
    """Whether a printed number is this value, rounded to its own last digit."""
    if value is None or printed in UNKNOWN:
        return value is None and printed in UNKNOWN
    printed = printed.replace(MINUS, "-")
    printed = printed.replace(",", ".")
    digits = len(printed.partition(".")[2])
    return abs(float(printed) - value) <= 0.5000001 * 10**-digits


def numbers(text, measured):
    """What the text lacks of volumes and of rows of agreement."""
    number, unknown = r"(\d+[.,]\d+)", "|".join(UNKNOWN)
    ratio, length = rf"([-{MINUS}]?\d+[.,]\d+|{unknown})", rf"(\d+[.,]\d+(?= mm)|{unknown})(?: mm)?"
    for point in measured["time_points"]:
        for mask in point["masks"]:
            found = re.findall(rf"(?<!\S){re.escape(mask['id'])} {number} ml", text)
            if not any(agrees(one, mask["volume_ml"]) for one in found):
                yield f"{mask['id']} of {mask['volume_ml']} ml: found {found}"
        for pair in point["pairs"]:
            of_both = rf"(?<!\S){re.escape(pair['a'])} {re.escape(pair['b'])} "
            for keys in AGREEMENT:
                rows = re.findall(of_both + " ".join(length if key.endswith("_mm") else ratio for key in keys), text)
                expected = [pair[key] for key in keys]
                if not any(all(map(agrees, row, expected)) for row in rows):
                    yield f"{pair['a']} and {pair['b']} of {expected}: found {rows}"


def syntax(pdf):
    try:
        return [f"qpdf: {one}" for one in pikepdf.open(io.BytesIO(pdf)).check_pdf_syntax()]
    except pikepdf.PdfError as why:
        return [f"qpdf: {why}"]


def faults(pdf, language, measured, hidden=(), shown=()):
    """What is wrong with the bytes of a PDF. `hidden`: words that are nowhere in it; `shown`: words that are in its text."""
    if found := syntax(pdf):
        return found
    file = pikepdf.open(io.BytesIO(pdf))
    root = file.Root
    if not root.get("/MarkInfo", {}).get("/Marked", False) or "/StructTreeRoot" not in root:
        found.append("it isn't tagged")
    if str(root.get("/Lang", "")) != language:
        found.append(f"its language is {root.get('/Lang')}")
    metadata = root.Metadata.read_bytes().decode() if "/Metadata" in root else ""
    for key, value in STANDARDS.items():
        if not re.search(rf"<{key}>{value}</{key}>", metadata):
            found.append(f"its metadata hasn't {key} {value}")
    document = pypdfium2.PdfDocument(pdf)
    texts = pages_text(document)
    for number, (page, text) in enumerate(zip(document, texts), 1):
        if drawn(page) < DRAWN or not text:
            found.append(f"page {number} is blank")
    text = " ".join(texts)
    found += numbers(text, measured)
    found += [f"{word} isn't in its text" for word in shown if bare(word) not in bare(text)]
    if hidden:
        places = [("text", text), ("metadata", metadata), *((f"object {n}", one) for n, thing in enumerate(file.objects) for one in strings(thing))]
        found += [f"{word} is in its {place}" for word in hidden for place, one in places if bare(word) in bare(one)]
    return found


def broken(pdf, word):
    """The same with a fault of every kind."""
    file = pikepdf.open(io.BytesIO(pdf))
    del file.Root.Lang
    file.Root.MarkInfo.Marked = False
    metadata = file.Root.Metadata.read_bytes().replace(b"<pdfaid:part>3<", b"<pdfaid:part>9<").replace(b"<dc:", f"<!--{word}--><dc:".encode(), 1)
    file.Root.Metadata = file.make_stream(metadata)
    file.Root.StructTreeRoot.Alt = pikepdf.String(word)
    file.Root.Packed = file.make_stream(word.encode())
    file.add_blank_page()
    out = io.BytesIO()
    file.save(out, compress_streams=True)
    return out.getvalue()


def faults_are_found(pdf, measured, word):
    """A check that can't fail is none."""
    wrong = {"time_points": [{"masks": [{**mask, "volume_ml": mask["volume_ml"] + 1} for mask in point["masks"]], "pairs": []} for point in measured["time_points"]]}
    found = faults(broken(pdf, word), "en", wrong, hidden=[word], shown=["not said"])
    expected = ["it isn't tagged", "its language is None", "its metadata hasn't pdfaid:part 3", "is blank", "ml: found", "isn't in its text", f"{word} is in its metadata"]
    lacking = [one for one in expected if not any(one in fault for fault in found)]
    if sum(f"{word} is in its object" in fault for fault in found) < 3:
        lacking.append("a word in an alternative text, in a packed stream and in the metadata's stream")
    # Its table of objects is cut off.
    if not syntax(pdf[:-60]):
        lacking.append("the file's damaged end")
    return lacking
