/* The functions that vibroimpact.fmus.core calls for the modes of beams, as the component finds them.
 *
 * Numbers out of their range are refused, never computed with. */
#ifndef VIBROIMPACT_DOOR_MODES_H
#define VIBROIMPACT_DOOR_MODES_H

/* beam_modes.h, modes 1 to count. Returns 0, or 1 for a bad argument. */
int vi_door_beam_modes(int boundary, int count, double eigenvalue[], double participation[]);

/* shape[point * count + mode - 1], or a derivative of order 0 to 3. Returns 0, or 1 for a bad argument. */
int vi_door_beam_shapes(int boundary, int count, int points, const double s[], int derivative, double shape[]);

#endif
