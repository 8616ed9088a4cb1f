/* The functions that vibroimpact.fmus.core calls for the modes of beams and chains, as the components find them.
 *
 * Numbers out of their range are refused, never computed with. */
#ifndef VIBROIMPACT_DOOR_MODES_H
#define VIBROIMPACT_DOOR_MODES_H

/* beam_modes.h, modes 1 to count. Returns 0, or 1 for a bad argument. */
int vi_door_beam_modes(int boundary, int count, double eigenvalue[], double participation[]);

/* shape[point * count + mode - 1], or a derivative of order 0 to 3. Returns 0, or 1 for a bad argument. */
int vi_door_beam_shapes(int boundary, int count, int points, const double s[], int derivative, double shape[]);

/* beam_residual.h, `points` vectors beside the first `natural` modes. Returns 0, 1 for a bad argument, 2 for points
 * that cannot be told apart, or from a support. */
int vi_door_beam_residual(int boundary, int natural, int points, const double point[], double eigenvalue[],
                          double participation[]);

/* shape[place * points + vector] of those vectors. Returns the same. */
int vi_door_beam_residual_shapes(int boundary, int natural, int points, const double point[], int places,
                                 const double s[], double shape[]);

/* chain_modes.h: stiffness and damping have `masses` + 1 elements, shape is [mass][mode]. Returns 0 where the damping does
 * not couple the modes, 1 where it does (damping_ratio is then of the diagonal), -1 for a bad argument. */
int vi_door_chain_modes(int masses, const double mass[], const double stiffness[], const double damping[],
                        double natural[], double damping_ratio[], double shape[]);

#endif
