from setuptools import setup

NAME = 'surefix_ros'

setup(
    name=NAME,
    version='0.1.0',
    description='Localizes a camera along a known route.',
    author='The surefix developers',
    license='MIT OR Apache-2.0',
    packages=[NAME],
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{NAME}']),
        (f'share/{NAME}', ['package.xml']),
        (f'share/{NAME}/launch', ['launch/localizer.launch.py']),
        (f'share/{NAME}/config', ['config/params.yaml']),
        (f'share/{NAME}/foxglove', ['foxglove/surefix.json']),
    ],
    install_requires=['setuptools'],
    zip_safe=True,
    entry_points={'console_scripts': [f'localizer = {NAME}.node:main']},
)
