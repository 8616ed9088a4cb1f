/* The motion of a structure over one step while stops press by power laws.
 *
 * The modes move by their exact flow. Each force F = K d^n (1 + damping d') is the polynomial through its values at the
 * Gauss nodes of the step. The depths there are those of the free motion less the responses to the forces: fixed-point
 * iteration finds both. equations.md 6.11
 */
#ifndef VIBROIMPACT_POWER_FLOW_H
#define VIBROIMPACT_POWER_FLOW_H

#include "body/modal/power_tables.h"

/* A pressed contact at the start of a step; its row of modes counts towards the stop. */
typedef struct {
    int port;
    double sign;
    vi_press press;
    double depth, rate, acceleration;
    double plain; /* force without damping, N */
    double toward[VI_POWER_ROW]; /* shape */
} vi_power_contact;

/* The body at the start of a step. Rows of modes have zeros behind the last mode. */
typedef struct {
    const vi_structure_model *model;
    const vi_power_tables *tables;
    int contacts;
    vi_power_contact contact[VI_PORTS];
    double cosine, sine; /* of the forcing phase */
    bool ramps;          /* does any input load slope? */
    double p[VI_POWER_ROW], slope[VI_POWER_ROW]; /* of a mode: velocity, and slope of its input load */
    double load[VI_POWER_ROW]; /* of a mode: its input load less its spring's force */
    double gain[VI_POWER_ROW]; /* acceleration by load and damping */
    double turn[VI_POWER_ROW]; /* rate of change of the load and of the spring's force */
} vi_power_start;

/* Values of one contact at the nodes of a step, and their series. */
typedef struct {
    double depth[VI_NODES], rate[VI_NODES], force[VI_NODES];
    double depth_series[VI_NODES], rate_series[VI_NODES], force_series[VI_NODES];
} vi_power_course;

/* Begin at this state, `u` seconds after the instant of its input loads. port[]: the pressed contacts; depth[]: of all
 * contacts. */
void vi_power_begin(vi_power_start *start, const vi_structure_model *model, const vi_power_tables *tables,
                    const vi_drift_start *state, double u, int contacts, const int port[], const double depth[]);

/* Find depths and forces of the contacts. Returns false where a contact ends or the iteration fails. */
bool vi_power_solve(const vi_power_start *start, const vi_power_level *level, vi_power_course course[]);

/* Displacements of the observed point at the nodes, from the start of the step. */
void vi_power_observe(const vi_power_start *start, const vi_power_level *level, const vi_power_course course[],
                      double moved[VI_NODES]);

/* Depths at the nodes of another contact with a power law, which is free, from `depth` at the start. */
void vi_power_other(const vi_power_start *start, const vi_power_level *level, const vi_power_course course[], int port,
                    double sign, double depth, double value[VI_NODES]);

/* Bound of a function with this series from below. A ripple between the nodes shows in the last coefficients. */
double vi_power_least(const double series[VI_NODES]);

/* Move the modes to the end of the step. */
void vi_power_end(const vi_power_start *start, const vi_power_level *level, const vi_power_course course[], double q[],
                  double p[]);

#endif
