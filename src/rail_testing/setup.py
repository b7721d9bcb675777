from setuptools import find_packages, setup

package_name = "rail_testing"

setup(
    name=package_name,
    version="0.1.0",
    description="Integration tests of equipment against the corridor, with pytest and without.",
    license="Apache-2.0",
    maintainer="Rail Corridor maintainers",
    maintainer_email="maintainers@rail-corridor.example",
    packages=find_packages(include=[package_name, f"{package_name}.*"]),
    package_data={"": ["py.typed", "page.html"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package_name}"]),
        (f"share/{package_name}", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=False,
    entry_points={
        "pytest11": ["rail_testing = rail_testing.plugin"],
        "rail_corridor.commands": ["conformance = rail_testing.conformance.command:conformance"],
    },
)
