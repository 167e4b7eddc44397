"""
The node's parameters: its own, and every option of the method from ``surefix.options``.

An option that the method gains becomes a parameter, and a launch argument, by itself.
"""

from collections.abc import Mapping
from dataclasses import dataclass
import math
from typing import Any

from surefix import Localizer, Map, Settings, SurefixValueError
from surefix.errors import mismatch
from surefix.options import Option, OPTIONS

# The word of a text parameter for an option that is None.
NONE = 'none'
KINDS = {bool: 'true or false', int: 'a whole number', float: 'a number', str: 'a text'}


@dataclass(frozen=True)
class Parameter:
    """
    A parameter: its default, what it is for, and its limits in words.

    Its type is that of the default. ``words`` are the texts that it may be; a parameter with
    ``numbers`` may be a number as well. A list is of the type ``of``.
    """

    name: str
    default: Any
    about: str
    limits: str = ''
    words: tuple[str, ...] = ()
    numbers: bool = False
    of: type = float

    def checked(self, value: Any) -> Any:
        """Return the value in the parameter's type; a SurefixValueError if it is of another."""
        kind = type(self.default)
        number = isinstance(value, (int, float)) and not isinstance(value, bool)
        if number and (kind is float or self.numbers):
            return float(value)
        if kind is list and not isinstance(value, (str, bytes)) and hasattr(value, '__iter__'):
            # ROS reads [1, 2] as whole numbers.
            value = [self.of(item) if type(item) is int else item for item in value]
            if all(type(item) is self.of for item in value):
                return value
        elif type(value) is kind and (not self.words or value in self.words):
            return value
        raise self.refusal(value)

    def refusal(self, value: Any) -> Exception:
        """Return the error of a value."""
        expected = KINDS.get(
            type(self.default), f'a list of {"texts" if self.of is str else "numbers"}'
        )
        if self.words:
            expected = ', '.join(map(repr, self.words)) + (' or a number' * self.numbers)
        elif self.limits:
            expected += f' ({self.limits})'
        return mismatch(f'parameter {self.name}', expected, repr(value))


def _of(option: Option) -> Parameter:
    """Return the parameter of an option of the method."""
    # A stream cannot know the whole matrix.
    default, words = option.default, tuple(w for w in option.choices if w != 'global')
    if option.type is list:
        default = list(default)
    elif option.type is str and default is None:
        default, words = NONE, (*words, NONE)
    # As with `surefix run`: a robot has a track.
    if option.name == 'motion':
        default = 'any'
    numbers = option.type is float and bool(words)
    # An example is as it is typed on the command line.
    limits = option.range.partition(', such as')[0]
    return Parameter(option.name, default, option.help, limits, words, numbers)


P = Parameter
PARAMETERS: tuple[Parameter, ...] = (
    P('map', '', 'The map.', 'a file from surefix map build'),
    P('fuse', [], "Other techniques' maps of the same places.", of=str),
    P('model', '', "The network of a map of learned descriptors; by default the map's own."),
    # An option at its default cannot be told from one that is not given.
    P('config', '', 'Settings from surefix tune; options here count if not at their defaults.'),
    P('threads', 0, 'Threads of the scan; 0 chooses by the size of the map.', '0 or more'),
    P('accept', 0.95, 'Fixes of this confidence are accepted; unused with a threshold.', '0 to 1'),
    P('accepted_only', False, 'Publish poses and degrees of accepted fixes only.'),
    P('image_topic', 'image', 'The camera.', 'not empty'),
    P('image_transport', 'raw', 'Image, or CompressedImage.', words=('raw', 'compressed')),
    P('image_reliability', 'best_effort', 'QoS of images.', words=('best_effort', 'reliable')),
    P('odometry_topic', '', 'A topic of nav_msgs/Odometry, which moves the track.'),
    P('places_per_metre', 0.0, "0: the map's. Below 0 if the x axis points back.", 'finite'),
    P('every', 0.0, 'Take an image every this many seconds; 0 takes all.', '0 or more'),
    P('metres', 0.0, 'Take an image every this many metres, by odometry.', '0 or more'),
    P('gap', 1.0, 'Images more than this many seconds apart are a break.', 'above 0'),
    P('frame_id', 'map', 'The frame of the poses: that of the positions in the map.'),
    *map(_of, OPTIONS),
)


def checked(values: Mapping[str, Any]) -> dict[str, Any]:
    """
    Return all parameters, in their types; those that are not given have their defaults.

    A SurefixValueError names the first that is wrong.
    """
    known = {each.name: each for each in PARAMETERS}
    unknown = sorted(values.keys() - known.keys())
    if unknown:
        raise mismatch('parameters', 'only those of surefix_ros', unknown[0])
    found = {name: each.checked(values.get(name, each.default)) for name, each in known.items()}
    inside = {name: bool(found[name]) for name in ('map', 'image_topic')}
    inside |= {name: found[name] >= 0 for name in ('every', 'metres', 'threads')}
    inside |= {'accept': 0 <= found['accept'] <= 1, 'gap': found['gap'] > 0}
    inside['places_per_metre'] = math.isfinite(found['places_per_metre'])
    for name in (name for name, right in inside.items() if not right):
        raise known[name].refusal(found[name])
    if found['metres'] and not found['odometry_topic']:
        raise mismatch('parameter metres', 'an odometry_topic too', 'none')
    return found


def settings_of(found: Mapping[str, Any]) -> Settings:
    """Return the settings of the config, and the options that are not at their defaults."""
    given = {}
    for parameter in map(_of, OPTIONS):
        value = found[parameter.name]
        if value != parameter.default or (parameter.name == 'motion' and not found['config']):
            given[parameter.name] = None if value == NONE else value
    return Settings(config=found['config'] or None, **given)


def localizer_of(found: Mapping[str, Any]) -> Localizer:
    """Return the localizer of checked parameters; a SurefixError says what is wrong."""
    names = [found['map'], *found['fuse']]
    maps = [Map.open(name) for name in names]
    networks = _networks(maps, names, found['model'])
    for name, other in zip(names, maps, strict=True):
        if len(other) != len(maps[0]):
            raise mismatch(name, f'a map of {len(maps[0])} places', len(other))
    several = len(maps) > 1
    return Localizer(
        maps if several else maps[0],
        descriptor=networks if several else networks[0],
        config=settings_of(found),
        threads=found['threads'] or None,
    )


def _networks(maps: list[Map], names: list[str], model: str) -> list[Any]:
    """Return the network of each map, which is looked for if no file is named."""
    from surefix.cli.drives import networks_of
    from surefix.cli.networks import ModelOptions
    import typer

    try:
        return list(networks_of(maps, names, ModelOptions(model or None), None, 'images'))
    except (typer.BadParameter, SurefixValueError) as error:
        network = 'the network that the map was made with'
        raise mismatch('parameter model', network, error) from None
