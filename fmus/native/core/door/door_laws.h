/* The table of contact laws for Python. */
#ifndef VIBROIMPACT_DOOR_LAWS_H
#define VIBROIMPACT_DOOR_LAWS_H

/* All numbers of laws are below this. */
int vi_door_most_laws(void);

/* Name of the law of a number, its kind of stop (vi_stop_kind), and whether another FMU acts; NULL: no such law. */
const char *vi_door_law(int number, int *stop, int *external);

#endif
