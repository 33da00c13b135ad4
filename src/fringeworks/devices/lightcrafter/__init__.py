"""The DLP LightCrafter (DLP3000), driven over TCP."""

from fringeworks.devices.lightcrafter.projector import LightCrafterProjector

__all__ = ["LightCrafterProjector"]
