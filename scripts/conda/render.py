"""Renders the recipe in this folder for all systems with py-rattler-build, and prints its packages: NAME VERSION, one per line."""
import sys
from pathlib import Path

from rattler_build import PlatformConfig, RattlerBuildError, RecipeParseError, RenderConfig, Stage0Recipe, VariantConfig

# conda-forge's pins.
PINNED = VariantConfig.from_yaml("python: [3.12.*]\nc_stdlib: [sysroot]\n")
found = set()
try:
    recipe = Stage0Recipe.from_file(Path(__file__).parent / "recipe.yaml")
    for system in ("linux-64", "linux-aarch64", "osx-64", "osx-arm64", "win-64"):
        for variant in recipe.render(PINNED, RenderConfig(PlatformConfig(target_platform=system))):
            found.add(f"{variant.recipe.package.name} {variant.recipe.package.version}")
except (RattlerBuildError, RecipeParseError) as error:
    sys.exit(f"scripts/conda/recipe.yaml: {error}")
print("\n".join(sorted(found)))
