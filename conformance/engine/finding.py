"""Find a device's axes by driving it a little: a motion map without a file (``roaas certify --drive``).

First the description says what can be commanded and what can be read. Then each number is commanded a little, forth and
back, and what changes meanwhile is its axis.
"""

from __future__ import annotations

import difflib
import posixpath
import re
from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, Self

import msgspec

from conformance.api.call_rules import CallRules, harmful_words
from conformance.api.rest.interface import RestInterface
from conformance.documents.openapi import Operation, is_json, is_xml
from conformance.engine.commanded import (
    Commanded,
    body_schema,
    commanded_by,
    is_velocity,
    numbers_in,
    parts_of,
    titles_in,
    with_query,
)
from conformance.engine.driven_numbers import Looks, numbers_of
from conformance.engine.found_preparation import (
    NOTHING,
    Preparing,
    is_excluded,
    lease_parameter,
    lease_place,
    members_of,
    named_preparing,
    preparing_of,
    wants_lease,
    wants_more,
)
from conformance.engine.map_text import direction_line, inline, string, template_of
from conformance.measures.samples import SEVERAL, Sample
from conformance.observe.clock import WALL_CLOCK, Clock
from conformance.scenarios.motion.binding import Binding
from conformance.scenarios.motion.preparing import Preparation
from conformance.scenarios.motion.templates import NoValueError, fill
from conformance.scenarios.scenario import NotPossibleError
from conformance.statement.motion_calls import NAME, named_by, names_operation
from conformance.transport.exchange import Exchange, Outgoing

_PACE_S: Final = 0.02
#: How many times a small change of a position is tried at most, where no limits are declared.
FARTHEST: Final = 10.0
_MOST_NUMBERS, _MOST_READS = 8, 6
#: How long a device may take to get ready, s.
READY_S = 20.0
#: A device that is ready within this time counts as ready at once, s.
_AT_ONCE_S = 0.3
#: A longer text is no state, characters.
_LONG = 40
# Members of a response that say whether the request failed, with what they have if it did not.
_FAILED: Final = (
    (re.compile(r"/error_?(?:number|code|no)?|/errno", re.IGNORECASE), 0),
    (re.compile(r"/ok|/success", re.IGNORECASE), True),
)
_STATE: Final = re.compile(
    r"state|status|pose|odom|position|velocit|speed|twist|telemetry|joint|axes|angle|azimuth|altitude|heading|height",
    re.IGNORECASE,
)
_LATCHES: Final = re.compile(r"emergency|e-?stop\b|latch|shut|until (?:it is )?reset", re.IGNORECASE)
_STOPS: Final = re.compile(
    r"(?:stop|halt|cancel|abort)(?:[-_]?(?:slew|goto|go|mov(?:e|es|ing|ement)|motion|all|ax[ie]s|drives?|robot|now))?",
    re.IGNORECASE,
)
# Words of a description which say that a device stops when no further velocity command arrives.
_HELD: Final = re.compile(
    r"(?=.*\b(?:stop|h[eo]ld|halt|rest|brak|watchdog))(?=.*\b(?:last|no|without)\b.*\b(?:command|twist|velocit|message|rates?\b))",
    re.IGNORECASE | re.DOTALL,
)
_TIME: Final = re.compile(r"(\d+(?:\.\d+)?|\bone|\ba) ?(m(?:illi)?)?s(?:ec(?:ond)?s?)?\b", re.IGNORECASE)
# Names of things that an operation called "stop" may end instead of a velocity.
_OTHERS: Final = re.compile(
    r"cancel|abort|mission|program|record|stream|daemon|server|scan|charg|navigat|goal|task|trajector|play",
    re.IGNORECASE,
)
_REPLACES: Final = re.compile(
    r"\bnew (?:target|goal|move|position)\b[^.;]*\b(?:replace|supersede|preempt|displace|override)s\b", re.IGNORECASE
)
#: The robot stays within ROOM_M, m, of its start; a fast robot within the way that it drives in ROOM_S, s.
ROOM_M, ROOM_S = 0.5, 2.5
#: How fast a device may seem to move at rest, as a share of its fastest.
AT_REST = 0.005
#: How long the device is watched before the first command, s.
_REST_S = 1.0


@dataclass(frozen=True)
class Plan:
    """The operations to command and to read, found in the description.

    Attributes:
        drive: the operation that commands.
        numbers: what it commands.
        reads: operations that may show it, the likeliest first.
        is_velocity: whether it commands velocities; else positions.
        stop: the operation beside it that stops the device, by its name; or None.
        named: the operation that commands as the description has it, without values in its path; None means the same.
        preparing: what the device may want before it moves.
        is_prepared: whether the user says that it wants that.
        text: what the description says of all operations and of this one.
    """

    drive: Operation
    numbers: tuple[Commanded, ...]
    reads: tuple[Operation, ...]
    is_velocity: bool
    stop: Operation | None = None
    named: Operation | None = None
    preparing: Preparing = NOTHING
    is_prepared: bool = False
    text: str = ""

    @property
    def holds_s(self) -> float | None:
        """How long a velocity holds after the last command, as the description says in words, s; None: it does not."""
        sentences = filter(_HELD.search, re.split(r"[.;!?](?:\s|$)", self.text))
        times = [one for sentence in sentences for one in _TIME.findall(sentence)]
        found = ((float(number) if number[0].isdigit() else 1.0) / (1000 if milli else 1) for number, milli in times)
        return max(found, default=None)

    @property
    def replaces(self) -> bool:
        """Whether the description says in words that a new target replaces that under way."""
        return bool(_REPLACES.search(self.text))

    def lines(self) -> Iterator[str]:
        """Yield the planned steps as lines for the user."""
        yield f"{self.drive.label} commands, by its description:"
        for command in self.numbers:
            bounds, tried = command.bounds, f"tried at {command.little:g}"
            declared = f"{bounds[0]:g} to {bounds[1]:g}, {command.source}" if bounds else "no limits declared"
            if not (bounds or self.is_velocity):
                tried += f", and up to {FARTHEST * command.little:g} where it is there at once"
            yield f"  {command.name:<16} {declared}; {tried}"
        yield f"Read meanwhile: {', '.join(operation.label for operation in self.reads)}."
        yield from self.preparing.announce(at_once=self.is_prepared)
        far = max(abs(end) for command in self.numbers for end in command.limits)
        driven = f"up to {far:g} per second, no farther than {max(ROOM_M, ROOM_S * far):g} from where it is"
        yield f"Then it is judged: {driven if self.is_velocity else 'within the limits of the map that is found'}."


def plan_of(
    operations: Sequence[Operation],
    drive: str,
    read: str | None,
    rules: CallRules,
    before: Sequence[str] = (),
    text: str = "",
) -> Plan:
    """Return the operations to command and to read, from a description.

    Args:
        operations: operations of the description.
        drive: names the operation that commands.
        read: names the one that shows where the device is; None if it is chosen.
        rules: what may be called.
        before: what the user sends before.
        text: what the description says of all operations.

    Raises:
        NotPossibleError: it says too little; the message says what.
    """
    named = _operation_named(operations, drive, "--drive")
    if is_excluded(named, rules):
        raise NotPossibleError(f"{named.label} must never be called: the description or --never says so")
    values = _values_in(named, drive)
    known = [_with_values(operation, values) for operation in operations]
    chosen = known[operations.index(named)]
    preparing = named_preparing(known, before, rules) if before else preparing_of(known, chosen, rules)
    chosen = with_query(chosen, lease_parameter(chosen, "query") if preparing.lease else "")
    numbers = commanded_by(chosen)[:_MOST_NUMBERS]
    if not numbers:
        bodies = ", ".join(chosen.bodies) or "none"
        raise NotPossibleError(
            f"--drive {drive!r}: its path, query and body (declared: {bodies}) have no numbers to command"
        )
    # A second vector of attributes may be of a part that the device lacks: most cameras of ONVIF have no zoom.
    vector = posixpath.dirname(numbers[0].place)
    numbers = [one for one in numbers if "@" not in one.place or posixpath.dirname(one.place) == vector]
    commanded = {number.place for number in numbers}
    if missing := [
        item.name
        for item in chosen.parameter("path")
        if f"{{{item.name}}}" in chosen.template and f"{{{item.name}}}" not in commanded
    ]:
        raise NotPossibleError(
            f"--drive {drive!r}: write the path with a value for {{{missing[0]}}}, "
            f"as in {drive.replace(f'{{{missing[0]}}}', '1')!r}"
        )
    reads = []
    if read:
        told = _operation_named(operations, read, "--read")
        reads = [_with_values(told, {**values, **_values_in(told, read)})]
    # A position is read by its name; a number called as a velocity may only repeat what was commanded.
    drives = is_velocity(chosen, numbers)
    named_alike = () if drives else numbers
    names = frozenset(command.place.strip("{}").rpartition("/")[2].lower() for command in named_alike)
    reads = reads or list(_reads(known, rules, chosen.template, names))[:_MOST_READS]
    if not reads:
        raise NotPossibleError("the description has no GET with JSON that could show where the device is: give --read")
    stop, said = stop_beside(known, chosen), f"{text}. {named.text}"
    if drives and stop and (stop.method == "DELETE" or _OTHERS.search(f"{stop.template} {stop.text}")):
        stop = None
    return Plan(chosen, tuple(numbers), tuple(reads), drives, stop, named, preparing, bool(before), said)


def _values_in(operation: Operation, call: str) -> dict[str, str]:
    """Return the values that a call has in an operation's path, by parameter."""
    if names_operation(operation.label, call) or " " not in call:
        return {}
    path = call.strip().partition(" ")[2]
    pairs = zip(operation.template.split("/"), path.split("/"), strict=True)
    return {name.strip("{}"): value for name, value in pairs if name != value and "{" not in value}


def _with_values(operation: Operation, values: Mapping[str, str]) -> Operation:
    """Return an operation with fixed values for some parameters of its path."""
    if not any(item.name in values for item in operation.parameter("path")):
        return operation
    path = NAME.sub(lambda name: values.get(name[1], name[0]), operation.template)
    left = tuple(item for item in operation.parameters if item.where != "path" or item.name not in values)
    return replace(operation, template=path, parameters=left)


def stop_beside(operations: Sequence[Operation], drive: Operation) -> Operation | None:
    """Return the nearest operation below the drive, in its folder or around it, called stop; else a move's DELETE."""
    path = drive.template.partition("?")[0]
    stops = [
        operation
        for operation in operations
        if _STOPS.fullmatch(posixpath.basename(operation.template))
        and operation.method in {"POST", "PUT"}
        and not _LATCHES.search(operation.text)
        and f"{path}/".startswith(f"{posixpath.dirname(operation.template).rstrip('/')}/")
    ]
    found = max(stops, key=lambda operation: operation.template.count("/"), default=None)
    if found is None:
        own = re.compile(rf"{re.escape(path)}/\{{[^{{}}]+\}}")
        return next((one for one in operations if one.method == "DELETE" and own.fullmatch(one.template)), None)
    known = {lease_parameter(found, "header"), *NAME.findall(path)}
    return None if found.never or any(one.required and one.name not in known for one in found.parameters) else found


def _operation_named(operations: Sequence[Operation], label: str, option: str) -> Operation:
    labels = named_by([label.strip()], [operation.label for operation in operations])
    found = next(
        (operation for operation in operations if operation.label in labels or operation.id == label.strip()), None
    )
    if found is None:
        near = difflib.get_close_matches(label, [operation.label for operation in operations], 1, 0)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        raise NotPossibleError(f"{option} {label!r} is no operation of the description{hint}")
    return found


def _reads(operations: Sequence[Operation], rules: CallRules, drive: str, names: frozenset[str]) -> Iterator[Operation]:
    """Yield readable operations with JSON: with a commanded name, in the folder of the command's path, or a state."""
    found = [
        operation
        for operation in operations
        if (operation.method == "GET" or operation.reads)
        and rules.decide(operation).may
        and not harmful_words(operation)
        and any(map(is_json, operation.formats))
        and not any(item.required for item in operation.parameters)
    ]
    beside = posixpath.dirname(drive)
    yield from sorted(
        found,
        key=lambda operation: (
            -len(names & {at.rpartition("/")[2].lower() for at, _ in numbers_in(operation.shape or {})}),
            posixpath.basename(operation.template).lower() not in names,
            not operation.template.startswith(f"{beside.rstrip('/')}/"),
            not _STATE.search(f"{operation.template.removeprefix(beside)} {operation.id}"),
        ),
    )


class Finder(ABC):
    """Drives a device a little, and finds the members that show the movement.

    Args:
        api: the device.
        binding: how calls become requests.
        plan: what can be commanded and read.
        clock: by which it is watched.

    Attributes:
        seconds: the duration that is asked for, where the operation takes one.
        lines: the TOML of the map that was found.
        notes: what was seen on the way, for a person.
    """

    seconds = 1.0

    def __init__(self, api: RestInterface, binding: Binding, plan: Plan, clock: Clock = WALL_CLOCK) -> None:
        self._api, self._binding, self._plan, self._clock = api, binding, plan, clock
        self._begin()
        self._answer: Any = None
        self._left, self._used, self._is_accepted = plan.preparing, NOTHING, False
        self._asked, self._words, self._last_words = 0.0, dict[str, Any](), dict[str, Any]()
        self._failed: tuple[str, Any] | None = None
        self._ready = Preparation(self._used, binding, self._exchange, clock)

    def _begin(self) -> None:
        titles = {at: name for one in self._plan.reads for at, name in titles_in(one.shape).items()}
        self._looks, self._turn, self._reads = Looks(titles), 0, list(self._plan.reads)
        self.lines, self.notes = list[str](), list[str]()

    def find(self) -> Self:
        """Find the map of the device, which is made ready first if it wants that, and left as it was.

        Raises:
            NotPossibleError: nothing shows that it moves; the message says what was tried.
            NoAnswerError: there is no response.
        """
        try:
            is_needed = self._plan.is_prepared or (self._left.lease is not None and wants_lease(self._plan.drive))
            while is_needed and self._prepare() and self._plan.is_prepared:
                pass
            try:
                self._find()
            except NotPossibleError:
                if not (self._is_accepted and self._prepare()):
                    raise
                while self._prepare():
                    pass
                self._begin()
                self._find()
        finally:
            try:
                self._ready.end()
            except NotPossibleError as problem:
                self.notes.append(f"{problem}.")
        self.lines = [*self._used.lines(self._failed), *self.lines]
        return self

    @abstractmethod
    def _find(self) -> None:
        """Drive the device a little, and keep the lines of its map.

        Raises:
            NotPossibleError: nothing shows that it moves; the message says what was tried.
            NoAnswerError: there is no response.
        """

    def _prepare(self) -> bool:
        """Send the next of what the device may want before it moves; return whether it accepted one."""
        lease, drive = self._left.lease, self._plan.named or self._plan.drive
        if lease is not None:
            self._left = replace(self._left, lease=None)
            exchange = self._send(lease.acquire, lease.body)
            if exchange.response.ok:
                content = self._binding.content(exchange.response.body)
                self._used = replace(self._used, lease=lease).with_token(drive, content)
                self._ready.motion = self._used
                self._ready.hold(self._used.lease or lease, exchange)
                return True
            self.notes.append(f"{lease.acquire} got {exchange.came}.")
        while self._left.steps:
            (step, ends), *rest = self._left.steps
            self._left = replace(self._left, steps=tuple(rest))
            self._words = self._states()
            exchange = self._send(step.send, step.body)
            if self._took(exchange):
                self._used = replace(self._used, steps=(*self._used.steps, (step, ends)))
                self._ready.motion, self._asked = self._used, self._clock.now()
                return True
            self.notes.append(f"{step.send} got {exchange.came}.")
        return False

    def _waits(self) -> bool:
        """Wait a little while the device gets ready; return whether it still has time for that."""
        self._clock.sleep(_PACE_S)
        # Texts that the device returns before an accepted command, and not while it carries out the command.
        self._last_words = self._states() if self._words else {}
        return bool(self._used.steps) and self._clock.now() < self._asked + READY_S

    def _note_ready(self) -> None:
        """Note what shows that the device is ready, if it had to be awaited after the last step: what changed since."""
        if self._is_accepted and self._used.steps and self._clock.now() > self._asked + _AT_ONCE_S and self._words:
            (step, ends), read = self._used.steps[-1], self._plan.reads[0].label
            several = [*self._last_words.items(), *self._states().items()]
            changed = [(at, word) for at, word in several if self._words.get(at) != word]
            # "homing" and "moving" are not what shows that it is ready.
            for at, word in sorted(changed, key=lambda one: str(one[1]).lower().endswith("ing"))[:1]:
                step = msgspec.structs.replace(step, read=read, at=at, shows=word)
                self._used = replace(self._used, steps=(*self._used.steps[:-1], (step, ends)))
        self._words = {}

    def _states(self) -> dict[str, Any]:
        """Return the states in the first reading, by JSON pointer: values that are neither numbers nor long texts."""
        content = self._binding.content(self._send(self._plan.reads[0].label, None).response.body)
        members = members_of(content)
        return {
            at: word for at, word in members if isinstance(word, bool) or (isinstance(word, str) and len(word) < _LONG)
        }

    def _template(self, names: Mapping[str, Any]) -> Any:
        """Return the body of a command with templates at some places, and with the lease if it has a place for one."""
        schema = body_schema(self._plan.drive)
        if schema is None:
            return None
        lease = self._used.lease
        is_elsewhere = lease is None or not lease.token or lease.header or "{lease}" in self._plan.drive.template
        at = "" if is_elsewhere else lease_place(self._plan.drive)
        return template_of(schema, {**names, at: "{lease}"} if at else names)

    @property
    @abstractmethod
    def _body(self) -> Any:
        """The body of a command; None if it has none."""

    def _sending_lines(self, names: Collection[str], still: Mapping[str, float], seconds: object) -> Iterator[str]:
        """Yield the lines of the map for a command: numbers by name, and the values for those that stay ``still``."""
        template = self._plan.drive.label
        for name, value in still.items():
            template = template.replace(f"{{{name}}}", f"{value:g}")
        yield f"send = {string(template)}"
        if self._body is not None:
            named = {name: f"{{{name}}}" for name in names}
            yield f"body = {inline(fill(self._body, {**named, **still, 'seconds': seconds, 'lease': '{lease}'}))}"
            yield from (direction_line(one) for one in self._plan.numbers if one.name in names and one.direction)

    def _refusal_lines(self, *, declared: bool) -> Iterator[str]:
        """Yield that values beyond the limits are refused, if the description declares that and the limits."""
        if declared and {"400", "422", "4XX", "4xx"} & self._plan.drive.responses.keys():
            yield 'beyond_limits = "refused"  # the description declares limits, and a response for invalid requests'

    def _stop_call(self) -> tuple[str, Any] | None:
        """Return path and body of the stop that belongs to the operation; None if it needs values that are unknown."""
        stop = self._plan.stop
        if stop is None:
            return None
        # A message of SOAP has its usual values.
        schema = body_schema(stop) if self._binding.syntax == "JSON" else None
        wanted = [name for part in parts_of(schema) for name in part.get("required", ())]
        told = self._answer if isinstance(self._answer, dict) else {}
        ids = {name: name if name in told else "id" for name in NAME.findall(stop.template)}
        if any(name not in told for name in (*wanted, *ids.values())):
            self.notes.append(f"{stop.label} is not used: what it takes ({', '.join(wanted)}) is not known.")
            return None
        call = NAME.sub(lambda name: f"{{goto:/{ids[name[1]]}}}", stop.label)
        return call, {name: f"{{goto:/{name}}}" for name in wanted} or None

    def _stop_lines(self, rests_s: float, source: str) -> Iterator[str]:
        """Yield the stop that belongs to the operation that moves the device, if its parameters are known."""
        if (found := self._stop_call()) is not None:
            yield ""
            yield "[motion.stop]"
            yield f"send = {string(found[0])}"
            yield from ([f"body = {inline(found[1])}"] if found[1] else [])
            yield f"rests_within_s = {rests_s:.3g}  # {source}"

    def _turn_words(self, number: Commanded) -> Commanded:
        """Exchange the words for both directions of a number in the plan, and return it."""
        at, positive, negative = number.direction or ("", "", "")
        turned = replace(number, direction=(at, negative, positive))
        numbers = (turned if one.name == number.name else one for one in self._plan.numbers)
        self._plan = replace(self._plan, numbers=tuple(numbers))
        return turned

    def _look(self) -> None:
        """Read one operation; an operation without numbers is not read again."""
        operation = self._reads[self._turn % len(self._reads)]
        self._turn += 1
        sent = self._clock.now()
        exchange = self._send(operation.label, None)
        answer = exchange.response
        in_xml = is_xml(answer.media_type)
        numbers = numbers_of(self._binding.content(answer.body), in_xml=in_xml) if answer.ok else {}
        moment = (sent + self._clock.now()) / 2
        if numbers:
            self._looks.add(operation.label, moment, numbers)
        elif len(self._reads) > 1:
            self._reads.remove(operation)
        else:
            raise NotPossibleError(f"{operation.label} got {exchange.came}, without numbers that show where it is")
        self._clock.sleep(sent + _PACE_S - self._clock.now())

    def _watch(self, seconds: float) -> None:
        """Read for some time, and each operation several times."""
        until, least = self._clock.now() + seconds, SEVERAL * len(self._reads)
        while self._clock.now() < until or least > 0:
            self._look()
            least -= 1

    def _watch_at_rest(self) -> None:
        """Read what the device shows at rest, before it is driven."""
        begun = self._clock.now()
        self._watch(_REST_S)
        self._rested = begun, self._clock.now()

    def _at_rest(self, operation: str, place: str) -> list[Sample]:
        """Return the samples of a place before the device was driven."""
        return self._looks.samples(operation, place, *self._rested)

    def _took(self, exchange: Exchange) -> bool:
        """Return whether a command was accepted: by its status, and by what the content says of an error."""
        if not exchange.response.ok:
            return False
        for at, said in members_of(self._binding.content(exchange.response.body), depth=0):
            for words, right in _FAILED:
                if words.fullmatch(at) and type(said) is type(right):
                    self._failed = at, right
                    return bool(said == right)
        return True

    def halt(self) -> str:
        """Stop the device, unless its last command ends by itself; return why it may still move, or nothing."""
        return ""

    def _send(self, call: str, body: Any) -> Exchange:
        self._ready.keep()
        return self._exchange(self._ready.with_lease(self._binding.make(call, body)))

    def _exchange(self, made: Outgoing) -> Exchange:
        return self._api.client.send(made.method, made.target, headers=made.headers, body=made.body)

    def _command(self, values: Mapping[str, float]) -> Exchange:
        """Command some numbers; the others are 0, or as near as their limits allow.

        As long as the device refuses each command, it gets what it may want before it moves.
        """
        while True:
            try:
                exchange = self._send(*self._call_and_body(values))
            except NoValueError as error:
                raise NotPossibleError(str(error)) from error
            took = self._took(exchange)
            self._is_accepted = self._is_accepted or took
            if took or not wants_more(exchange) or self._is_accepted or not (self._prepare() or self._waits()):
                self._note_ready()
                return exchange

    def _call_and_body(self, values: Mapping[str, float]) -> tuple[str, Any]:
        """Return call and body of a command.

        Raises:
            NoValueError: a value cannot be written at its place.
        """
        zero = {command.name: min(max(0.0, command.limits[0]), command.limits[1]) for command in self._plan.numbers}
        written: dict[str, Any] = {**zero, **values, "seconds": self.seconds, "lease": self._ready.lease}
        for command in self._plan.numbers:
            if command.schema.get("type") == "integer":
                written[command.name] = round(written[command.name])
        return fill(self._plan.drive.label, written), fill(self._body, written)
