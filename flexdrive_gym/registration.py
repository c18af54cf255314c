"""The environments' ids in Gymnasium's registry.

Importing the package registers them, and so does :mod:`flexdrive_gym.start_up`, which runs this file by itself, without the
package. So nothing is imported at its top.
"""

IDS = {
    "FlexDrive-Collocated-v0": "collocated",
    "FlexDrive-NonCollocated-v0": "non_collocated",
    "FlexDrive-FullState-v0": "full_state",
}


def register() -> None:
    """Put the environments into Gymnasium's registry, by name: what they need is imported when one is made."""
    from gymnasium.envs import registration  # noqa: PLC0415

    for name, sensing in IDS.items():
        if name in registration.registry:
            continue
        # The environment keeps its own time limit and order of calls, so the wrappers that gymnasium.make adds by default would
        # cost more than the physics and find nothing.
        registration.register(
            id=name,
            entry_point="flexdrive_gym.environment:FlexDriveEnv",
            vector_entry_point="flexdrive_gym.vector:FlexDriveVectorEnv",
            order_enforce=False,
            disable_env_checker=True,
            kwargs={"sensing": sensing},
        )
