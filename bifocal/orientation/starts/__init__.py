"""First values: relative orientation, resection of each photo, which photo is the far one."""
