/* The functions that vibroimpact.fmus.modes calls: modes of chains and beams as the components find them.
 *
 * Matrices are row-major. Numbers out of their range are refused, never computed with. */
#ifndef VIBROIMPACT_DOOR_MODES_H
#define VIBROIMPACT_DOOR_MODES_H

/* Most masses of a chain, most points of a collocation grid. */
int vi_door_most_modes(void);

/* chain_modes.h: mass[masses], stiffness[masses + 1], damping[masses + 1]; natural and damping_ratio [masses], shape
 * and modal_damping [masses * masses]. Returns 1 when the damping does not couple the modes, 0 when it does, -1 for a
 * bad argument. */
int vi_door_chain_modes(int masses, const double mass[], const double stiffness[], const double damping[],
                        double natural[], double damping_ratio[], double shape[], double modal_damping[]);

/* beam_modes.h, modes 1 to count. Returns 0, or 1 for a bad argument. */
int vi_door_beam_modes(int boundary, int count, double eigenvalue[], double participation[]);

/* shape[point * count + mode - 1], or a derivative of order 0 to 3. Returns 0, or 1 for a bad argument. */
int vi_door_beam_shapes(int boundary, int count, int points, const double s[], int derivative, double shape[]);

/* Not a number for a bad argument. */
double vi_door_beam_static_stiffness(int boundary, double s);
double vi_door_beam_validity(int boundary, int j, double slenderness, double e_over_g, double shear_coefficient);

/* Returns 0, 1 for a bad argument, 2 when the grid is singular. */
int vi_door_beam_collocation(int boundary, int n, const double s[], int at, double direction[]);

#endif
