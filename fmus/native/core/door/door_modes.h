/* The functions that vibroimpact.fmus.core calls for the modes of beams and chains, with the results of the components.
 *
 * Numbers outside their range are refused.
 */
#ifndef VIBROIMPACT_DOOR_MODES_H
#define VIBROIMPACT_DOOR_MODES_H

/* Modes 1 to count of beam_modes.h. Returns 0, or 1 for a bad argument. */
int vi_door_beam_modes(int boundary, int count, double eigenvalue[], double participation[]);

/* shape[point * count + mode - 1], or a derivative of order 0 to 3. Returns 0, or 1 for a bad argument. */
int vi_door_beam_shapes(int boundary, int count, int points, const double s[], int derivative, double shape[]);

/* `points` residual vectors of beam_residual.h beside the first `natural` modes. Returns 0, 1 for a bad argument, 2 for
 * points too close to each other or to a support. */
int vi_door_beam_residual(int boundary, int natural, int points, const double point[], double eigenvalue[],
                          double participation[]);

/* shape[place * points + vector] of the same residual vectors, with the same results. */
int vi_door_beam_residual_shapes(int boundary, int natural, int points, const double point[], int places,
                                 const double s[], double shape[]);

/* Modes of chain_modes.h: stiffness and damping have `masses` + 1 elements, shape is [mass][mode], coupling is the
 * damping between the modes [mode][mode], 1/s. Returns 0, or -1 for a bad argument, or 1 where the damping couples the
 * modes; damping_ratio is then from the diagonal. */
int vi_door_chain_modes(int masses, const double mass[], const double stiffness[], const double damping[],
                        double natural[], double damping_ratio[], double shape[], double coupling[]);

/* Frequencies and shapes of a structure of springs. spring[row * columns + column] is the elongation of a spring times
 * sqrt(stiffness), for a displacement of 1 / sqrt(mass) of a coordinate. value[] has the `rank` angular frequencies
 * above 0, ascending, and vector[k * columns + column] their unit vectors. Returns the rank, or -1 for a bad argument. */
int vi_door_spring_modes(int rows, int columns, const double spring[], double value[], double vector[]);

/* The same where spring k counts with sign[k], 1 or -1: all eigenvectors of the sum of sign spring' spring. value[] has
 * their angular frequencies, ascending, negative where the eigenvalue is. Returns 0, or -1 for a bad argument, 1 where
 * the eigenvectors are not found, or memory is out. */
int vi_door_signed_modes(int rows, int columns, const double spring[], const double sign[], double value[],
                         double vector[]);

#endif
