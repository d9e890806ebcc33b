"""The styles in which the sprinklers are right, and their faults with the requirement that must notice each.

Where several faults of a run break one requirement, words of what it expects tell which one was noticed.
"""

_READ = "description/written-is-read"

RIGHT = {
    "as described": {},
    "without conditions": {"asks": False, "keys": False, "takes": 0.3, "late": 0.8, "utc": True},
    "no tags": {"etag": "none", "asks": False, "ranges": "none", "prints": False, "remembers": 2},
    "counts reads": {"counts": True, "etag": "weak", "asks": False},
    "another client": {"drifts": 0.9, "caches": 2},
    "keys that are refused again": {"background": True, "takes": 0.05, "repeats": "refused", "remembers": 3},
}
#: Faults that are found side by side in one run: the style, and for each fault the requirement that it breaks.
FAULTS = [
    (
        "as described",
        {
            "a stale If-Match is taken": "description/if-match",
            "another body gets the first answer": "description/idempotency-key",
            "a part begins one later": "http/range",
            "a file ends at NUL": _READ,
            "the digest is wrong": "description/digest",
        },
    ),
    (
        "as described",
        {
            "If-None-Match: * is not looked at": "description/if-match",
            "a stale If-Range gets a part": "description/entity-tag",
            "a repeated key acts and says nothing": "description/idempotency-key",
            "what is refused with 406 is created": "description/refused-keeps",
            "what is refused with 428 is written": "description/refused-keeps",
            "line ends of a file are changed": _READ,
        },
    ),
    (
        "as described",
        {
            "HEAD renames": "description/safe",
            "CSV lacks the last row": "description/same-values",
            "two decimals are kept": _READ,
        },
    ),
    (
        "as described",
        {
            "a forecast stops the rain": "description/safe",
            "the list shows another state": "description/same-values",
            "the offset is lost": _READ,
        },
    ),
    ("no tags", {"a cached list is old": "description/same-values", "numbers are single floats": _READ}),
    ("as described", {"several other tags are taken": "description/if-match", "CR LF becomes LF": _READ}),
    (
        "as described",
        {
            "If-Match takes a weak tag": "description/if-match",
            "the filter goes by the first area": "description/list-filter",
            "minutes are sorted as texts": "description/list-order",
            "the next key ends one": "description/idempotency-key",
            "leading zeros are lost": (_READ, "007"),
            "an upload goes to all": (_READ, "octets that PUT"),
            "a creation resets the settings": (_READ, "before things of collections were created"),
        },
    ),
    (
        "as described",
        {
            "any content type is taken": "description/invalid-refused",
            "a shorter file keeps the tail": _READ,
            "a refusal spends its key": "description/idempotency-key",
        },
    ),
    (
        "as described",
        {
            "two at once write by one tag": "description/if-match",
            "a file in chunks is empty": "description/digest",
            "a retry gets the thing as it is now": "description/idempotency-key",
            "Content-Location names the first": "description/own-identifier",
            "a change tells the old minutes": (_READ, "as it was sent and as the next GET shows it"),
        },
    ),
    (
        "as described",
        {"the list shows the first valve": "description/same-values", "later rounds take the first valve": _READ},
    ),
    (
        "without conditions",
        {
            "what is refused with 412 is written": "description/if-match",
            "two at once get one id": "description/created-is-there",
            "the season stays": _READ,
        },
    ),
]
