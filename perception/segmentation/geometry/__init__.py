"""Labels of ground and not ground from motion: plane sweeps over posed frames, without any mask."""
