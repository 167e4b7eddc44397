"""
The node's parameters: its own, and every option of the method from ``surefix.options``.

An option that the method gains becomes a parameter, and a launch argument, by itself.
"""

from collections.abc import Mapping
from dataclasses import dataclass
import math
from typing import Any

from surefix import Localizer, Map, Settings
from surefix.errors import mismatch
from surefix.options import Option, OPTIONS

# The word of a text parameter for an option that is None.
NONE = 'none'


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
            items = [self.of(item) if type(item) is int else item for item in value]
            if all(type(item) is self.of for item in items):
                return items
        elif type(value) is kind and kind is not list and (not self.words or value in self.words):
            return value
        names = {bool: 'true or false', int: 'a whole number', float: 'a number', str: 'a text'}
        expected = f'a list of {"texts" if self.of is str else "numbers"}'
        if self.words:
            expected = ', '.join(map(repr, self.words)) + (' or a number' * self.numbers)
        elif kind is not list:
            expected = names[kind]
        said = f' ({self.limits})' if self.limits and not self.words else ''
        raise mismatch(f'parameter {self.name}', expected + said, repr(value))


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
    return Parameter(option.name, default, option.help, option.range, words, numbers)


PARAMETERS: tuple[Parameter, ...] = (
    Parameter('map', '', 'The map, from surefix map build.'),
    Parameter('fuse', [], "Other techniques' maps of the same places.", of=str),
    Parameter('model', '', 'The ONNX file of a map of learned descriptors.'),
    Parameter(
        'config',
        '',
        'Settings from surefix tune. Beside them, only options that differ from their defaults '
        'count.',
    ),
    Parameter('threads', 0, 'Threads of the scan; 0 chooses by the size of the map.', '0 or more'),
    Parameter(
        'accept',
        0.95,
        'The confidence from which on a fix is accepted, unless the config has a threshold. '
        'Without motion, a fix is accepted if it is trusted.',
        '0 to 1',
    ),
    Parameter('accepted_only', False, 'Publish poses and degrees of accepted fixes only.'),
    Parameter('image_topic', 'image', 'The camera.'),
    Parameter(
        'image_transport',
        'raw',
        'raw for sensor_msgs/Image, compressed for sensor_msgs/CompressedImage.',
        words=('raw', 'compressed'),
    ),
    Parameter(
        'image_reliability',
        'best_effort',
        'The quality of service of the image subscription.',
        words=('best_effort', 'reliable'),
    ),
    Parameter('odometry_topic', '', 'A topic of nav_msgs/Odometry, which moves the track.'),
    Parameter(
        'places_per_metre',
        0.0,
        'Places that the robot passes in a metre; 0 for those of the map. Below 0 if the axis '
        'that it calls forward points against the route.',
        'a finite number',
    ),
    Parameter('every', 0.0, 'Take an image every this many seconds; 0 takes all.', '0 or more'),
    Parameter(
        'metres', 0.0, 'Take an image every this many metres, by odometry; 0: all.', '0 or more'
    ),
    Parameter(
        'gap', 1.0, 'Images more than this many seconds apart are a break.', 'greater than 0'
    ),
    Parameter('frame_id', 'map', 'The frame of the poses: that of the positions in the map.'),
    *map(_of, OPTIONS),
)


def checked(values: Mapping[str, Any]) -> dict[str, Any]:
    """
    Return all parameters, in their types; those that are not given have their defaults.

    A SurefixValueError names the first that is wrong.
    """
    unknown = sorted(values.keys() - {parameter.name for parameter in PARAMETERS})
    if unknown:
        raise mismatch('parameters', 'only those of surefix_ros', unknown[0])
    found = {each.name: each.checked(values.get(each.name, each.default)) for each in PARAMETERS}
    if not found['map']:
        raise mismatch('parameter map', 'a file from surefix map build', 'none')
    inside = {'accept': 0 <= found['accept'] <= 1, 'gap': found['gap'] > 0}
    inside['places_per_metre'] = math.isfinite(found['places_per_metre'])
    inside |= {name: found[name] >= 0 for name in ('every', 'metres', 'threads')}
    for name, right in inside.items():
        if not right:
            limit = next(each.limits for each in PARAMETERS if each.name == name)
            raise mismatch(f'parameter {name}', limit, found[name])
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
    for name, other in zip(names, maps, strict=True):
        if len(other) != len(maps[0]):
            raise mismatch(name, f'a map of {len(maps[0])} places', len(other))
    networks = _networks(maps, names, found['model'])
    for name, other, network in zip(names, maps, networks, strict=True):
        if other.descriptor is None and network is None:
            recipe = other.recipe or {}
            made = recipe.get('name', 'ready descriptors')
            raise mismatch('parameter model', f'the ONNX file of {name} (made by {made})', 'none')
    return Localizer(
        maps if len(maps) > 1 else maps[0],
        descriptor=networks if len(maps) > 1 else networks[0],
        config=settings_of(found),
        threads=found['threads'] or None,
    )


def _networks(maps: list[Map], names: list[str], model: str) -> list[Any]:
    if not model:
        return [None] * len(maps)
    from surefix.cli.drives import networks_of
    import typer

    try:
        return list(networks_of(maps, names, model))
    except typer.BadParameter as error:
        raise mismatch(
            'parameter model', 'the ONNX file that the map was made with', error
        ) from None
