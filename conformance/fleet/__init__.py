"""Many robots judged side by side: the fleet's file, a process for each robot, what came of them all."""
