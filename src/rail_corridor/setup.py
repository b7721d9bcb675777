from setuptools import find_packages, setup

package_name = "rail_corridor"

setup(
    name=package_name,
    version="0.1.0",
    description="Scenarios, launcher, report and the rail command line of the corridor.",
    license="Apache-2.0",
    maintainer="Rail Corridor maintainers",
    maintainer_email="maintainers@rail-corridor.example",
    packages=find_packages(include=[package_name, f"{package_name}.*"]),
    package_data={"": ["py.typed", "builtin/*.yaml", "fastdds*.xml", "static/*"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package_name}"]),
        (f"share/{package_name}", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=False,
    entry_points={"console_scripts": ["rail = rail_corridor.cli.main:main"]},
)
