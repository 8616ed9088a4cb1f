/* Responses of a body over steps of fixed lengths while a power law presses: tables made once and kept.
 *
 * Every mode moves by its exact flow. A contact force is a polynomial through its values at the Gauss nodes of a step.
 * The depths at the nodes and the modes at the end are then sums of products with these tables.
 */
#ifndef VIBROIMPACT_POWER_TABLES_H
#define VIBROIMPACT_POWER_TABLES_H

#include "body/modal/coupled_flow.h"
#include "body/modal/state.h"
#include "motion/legendre.h"

enum { VI_POWER_LEVELS = VI_ONLY_MODES == 1 ? 1 : 14 }; /* lengths of steps; a body of one mode has no such steps */
enum { VI_POWER_ROW = (VI_MODES + VI_COLUMNS - 1) / VI_COLUMNS * VI_COLUMNS }; /* a row of modes, in whole blocks */

/* Pairs of contacts, in either order. */
enum { VI_PAIRS = VI_PORTS * (VI_PORTS + 1) / 2 };

static inline int vi_pair_of_contacts(int k, int l)
{
    return k > l ? k * (k + 1) / 2 + l : l * (l + 1) / 2 + k;
}

/* A node's values for forces at the nodes: [k][i] at node i for the force 1 N at node k. */
typedef double vi_node_response[VI_NODES][VI_NODES];

/* Values at the nodes for the forces 1, t and t^2 / 2 of the time t since the start of the step. */
enum { VI_GROWTHS = 3 };
typedef double vi_growth_response[VI_GROWTHS][VI_NODES];

/* Responses over steps of one length. `wave`: to cos and sin of the angular frequency of the forcing. */
typedef struct {
    double step;                                          /* s; 0: the tables are not made yet */
    double of_rate[VI_MODES][VI_NODES]; /* displacement of a mode for its velocity 1, at the nodes */
    double of_load[VI_MODES][VI_NODES]; /* for a constant load 1 */
    double of_ramp[VI_MODES][VI_NODES]; /* for a load that grows by 1 per second */
    double of_rate_end[VI_POWER_ROW]; /* the first of these at the end */
    double moment[VI_NODES][VI_POWER_ROW]; /* displacement of a mode at the end for the force P_n */
    double moment_rate[VI_NODES][VI_POWER_ROW]; /* its velocity */
    double wave_end[2][VI_POWER_ROW], wave_end_rate[2][VI_POWER_ROW]; /* of a mode at the end, for the force 1 */
    vi_node_response yield[VI_PAIRS], yield_rate[VI_PAIRS]; /* displacement and velocity of one of a pair of contacts */
    vi_growth_response grows[VI_PAIRS], grows_rate[VI_PAIRS]; /* of the same */
    vi_node_response seen[VI_PORTS]; /* displacement of the observed point, for that force */
    double wave[VI_PORTS][2][VI_NODES], wave_rate[VI_PORTS][2][VI_NODES]; /* of a contact, for the body's forcing */
    double wave_seen[2][VI_NODES]; /* of the observed point */
    double reach[VI_PORTS]; /* velocity of a contact after a force of 1 N and this length, at most, m/s */
} vi_power_level;

/* Cache, no part of a body's state: its contents follow from the model. */
struct vi_power_tables {
    int32_t modes, contacts, rows, exist, prepared; /* exist: do all modes have closed forms? */
    double angular_frequency;
    /* of the body for which they were made, with zeros behind the last mode */
    double stiffness[VI_POWER_ROW], decay[VI_POWER_ROW], force[VI_POWER_ROW];
    double shape[VI_PORTS][VI_MODES], observed[VI_MODES];
    vi_press press[VI_PORTS];
    vi_legendre basis;
    vi_power_level level[VI_POWER_LEVELS]; /* each with twice the step of the level before */
};

/* Make the tables fit this body. Returns false where a mode has no closed form. */
bool vi_power_tables_fit(vi_power_tables *tables, const vi_structure_model *model);

/* Length of the steps of a level, s. */
double vi_power_step_of(const vi_structure_model *model, int level);

/* Responses of a level, made when they are first needed. */
const vi_power_level *vi_power_level_of(vi_power_tables *tables, const vi_structure_model *model, int level);

#endif
