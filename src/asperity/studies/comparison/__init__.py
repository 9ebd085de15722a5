"""Methods of rendering side by side: the same motion, and properties measured one by one."""
