"""Both programs as click commands, called without a process."""

from bifocal.cli.main import main as bifocal_command
from multimedia.cli.main import main as multimedia_command

__all__ = ["bifocal_command", "multimedia_command"]
