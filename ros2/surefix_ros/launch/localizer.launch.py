"""Start the localizer; each of its parameters is a launch argument."""

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from surefix_ros.parameters import Parameter, PARAMETERS
import yaml

FILE = 'params_file'


def text_of(parameter: Parameter) -> str:
    """Return the default as it would be typed."""
    default = parameter.default
    return default if isinstance(default, str) else yaml.safe_dump(default).split('\n')[0]


def start(context: LaunchContext) -> list[Node]:
    """Return the node: the file's parameters, and the arguments that were given."""
    given = {}
    for each in PARAMETERS:
        text = LaunchConfiguration(each.name).perform(context)
        if text != text_of(each):
            word = isinstance(each.default, str) and not each.numbers
            given[each.name] = each.checked(text if word else yaml.safe_load(text))
    file = LaunchConfiguration(FILE).perform(context)
    # ROS refuses a file, and launch writes one, without parameters.
    parameters = [part for part in (file, given) if part]
    node = Node(
        package='surefix_ros',
        executable='localizer',
        name='surefix',
        output='screen',
        parameters=parameters,
    )
    return [node]


def generate_launch_description() -> LaunchDescription:
    """Return the arguments and the node."""
    arguments = [
        DeclareLaunchArgument(each.name, default_value=text_of(each), description=each.about)
        for each in PARAMETERS
    ]
    described = 'A file of parameters, such as config/params.yaml; arguments count more.'
    file = DeclareLaunchArgument(FILE, default_value='', description=described)
    return LaunchDescription([*arguments, file, OpaqueFunction(function=start)])
