#include "body/modal/power_tables.h"

#include <math.h>
#include <string.h>

#include "motion/majorant.h"
#include "motion/moments.h"

/* Shortest step, in radians of the fastest rate. */
static const double SHORTEST_STEP = 0.0625;

static bool same_body(const vi_power_tables *t, const vi_structure_model *model)
{
    const size_t size = (size_t)vi_structure_modes(model) * sizeof(double);
    bool same = t->modes == vi_structure_modes(model) && t->contacts == model->contacts
                && t->rows == model->rows && t->angular_frequency == model->clock.angular_frequency
                && memcmp(t->observed, model->observed, size) == 0;
    for (int j = 0; j < vi_structure_modes(model) && same; ++j) {
        const vi_mode *mode = &model->mode[j];
        same = t->stiffness[j] == mode->stiffness && t->decay[j] == mode->decay && t->force[j] == mode->force;
    }
    for (int k = 0; k < model->contacts && same; ++k) {
        same = memcmp(t->shape[k], model->shape[k], size) == 0 && t->press[k].kind == model->press[k].kind;
    }
    for (int r = model->contacts; r < model->rows && same; ++r) {
        same = memcmp(t->shape[r], model->shape[r], size) == 0;
    }
    return same;
}

bool vi_power_tables_fit(vi_power_tables *t, const vi_structure_model *model)
{
    if (same_body(t, model)) {
        return t->exist;
    }
    const size_t size = (size_t)vi_structure_modes(model) * sizeof(double);
    t->modes = vi_structure_modes(model);
    t->contacts = model->contacts;
    t->rows = model->rows;
    t->angular_frequency = model->clock.angular_frequency;
    t->exist = model->fastest > 0.0;
    memcpy(t->observed, model->observed, size);
    memset(t->stiffness, 0, sizeof t->stiffness);
    memset(t->decay, 0, sizeof t->decay);
    memset(t->force, 0, sizeof t->force);
    for (int j = 0; j < t->modes; ++j) {
        t->stiffness[j] = model->mode[j].stiffness;
        t->decay[j] = model->mode[j].decay;
        t->force[j] = model->mode[j].force;
        t->exist = t->exist && vi_moments_exist(&model->mode[j]);
    }
    for (int r = 0; r < model->rows; ++r) {
        memcpy(t->shape[r], model->shape[r], size);
    }
    for (int k = 0; k < model->contacts; ++k) {
        t->press[k] = model->press[k];
    }
    for (int l = 0; l < VI_POWER_LEVELS; ++l) {
        t->level[l].step = 0.0;
    }
    if (!t->prepared) {
        vi_legendre_prepare(&t->basis);
        t->prepared = 1;
    }
    return t->exist;
}

double vi_power_step_of(const vi_structure_model *model, int level)
{
    return SHORTEST_STEP * model->radian * (double)(1 << level);
}

/* Series over `length` seconds of cos and sin of the forcing's turn. */
static void wave_series(const vi_power_tables *t, double length, double series[2][VI_NODES])
{
    double value[2][VI_NODES];
    for (int i = 0; i < VI_NODES; ++i) {
        const double turn = t->angular_frequency * (length * t->basis.node[i]);
        value[0][i] = cos(turn);
        value[1][i] = sin(turn);
    }
    vi_legendre_series(&t->basis, value[0], series[0]);
    vi_legendre_series(&t->basis, value[1], series[1]);
}

static double product(const double a[VI_NODES], const double b[VI_NODES])
{
    double sum = 0.0;
    for (int n = 0; n < VI_NODES; ++n) {
        sum += a[n] * b[n];
    }
    return sum;
}

/* Responses of all modes over the way to one node, for forces that are Legendre polynomials over this way. */
typedef struct {
    double x[VI_MODES][VI_NODES], v[VI_MODES][VI_NODES];
} way_responses;

/* Response at node i of a point with weights of the modes, for forces 1 at the nodes of the whole step. */
static void respond(const vi_power_tables *t, int i, const double weight[], double way[VI_MODES][VI_NODES],
                    vi_node_response response)
{
    double over_way[VI_NODES] = {0.0}, over_step[VI_NODES];
    vi_rows_combine(over_way, way[0], VI_NODES, weight, t->modes, VI_NODES);
    for (int n = 0; n < VI_NODES; ++n) {
        over_step[n] = product(t->basis.part[i][n], over_way);
    }
    for (int k = 0; k < VI_NODES; ++k) {
        response[k][i] = product(t->basis.series[k], over_step);
    }
}

/* Response at node i to forces that grow, from the response to forces at the nodes. */
static void respond_to_growth(const vi_power_tables *t, double step, vi_node_response response, int i,
                              vi_growth_response grows)
{
    for (int k = 0; k < VI_NODES; ++k) {
        const double time = step * t->basis.node[k];
        grows[0][i] += response[k][i];
        grows[1][i] += time * response[k][i];
        grows[2][i] += 0.5 * time * time * response[k][i];
    }
}

/* Response at node i of a point with this shape, for the body's forcing. */
static void respond_to_wave(const vi_power_tables *t, const double shape[], double wave[2][VI_NODES], int i,
                            double way[VI_MODES][VI_NODES], double response[2][VI_NODES])
{
    double weight[VI_MODES], over_way[VI_NODES] = {0.0};
    for (int j = 0; j < t->modes; ++j) {
        weight[j] = shape[j] * t->force[j];
    }
    vi_rows_combine(over_way, way[0], VI_NODES, weight, t->modes, VI_NODES);
    response[0][i] = product(wave[0], over_way);
    response[1][i] = product(wave[1], over_way);
}

/* Responses at node i of contact k, to its force and to earlier contacts' forces, and of the observed point. */
static void make_contact(const vi_power_tables *t, vi_power_level *level, int k, int i, double wave[2][VI_NODES],
                         way_responses *way)
{
    double weight[VI_MODES];
    for (int l = 0; l <= k; ++l) {
        for (int j = 0; j < t->modes; ++j) {
            weight[j] = t->shape[k][j] * t->shape[l][j];
        }
        if (t->press[l].kind == VI_PRESS_POWER) {
            const int pair = vi_pair_of_contacts(k, l);
            respond(t, i, weight, way->x, level->yield[pair]);
            respond(t, i, weight, way->v, level->yield_rate[pair]);
            respond_to_growth(t, level->step, level->yield[pair], i, level->grows[pair]);
            respond_to_growth(t, level->step, level->yield_rate[pair], i, level->grows_rate[pair]);
        }
    }
    for (int j = 0; j < t->modes; ++j) {
        weight[j] = t->shape[k][j] * t->observed[j];
    }
    respond(t, i, weight, way->x, level->seen[k]);
    respond_to_wave(t, t->shape[k], wave, i, way->x, level->wave[k]);
    respond_to_wave(t, t->shape[k], wave, i, way->v, level->wave_rate[k]);
}

/* Responses at node i of a further observed point, whose row of shape is r, to the forces and the forcing. */
static void make_point(const vi_power_tables *t, vi_power_level *level, int r, int i, double wave[2][VI_NODES],
                       way_responses *way)
{
    double weight[VI_MODES];
    for (int l = 0; l < t->contacts; ++l) {
        for (int j = 0; j < t->modes; ++j) {
            weight[j] = t->shape[r][j] * t->shape[l][j];
        }
        if (t->press[l].kind == VI_PRESS_POWER) {
            respond(t, i, weight, way->x, level->yield[vi_pair_of_contacts(r, l)]);
        }
    }
    respond_to_wave(t, t->shape[r], wave, i, way->x, level->wave[r]);
}

/* Responses at node i. */
static void make_node(const vi_power_tables *t, vi_power_level *level, const vi_structure_model *model, int i)
{
    const double length = level->step * t->basis.node[i];
    double wave[2][VI_NODES], phi[4];
    way_responses way;
    wave_series(t, length, wave);
    for (int j = 0; j < t->modes; ++j) {
        vi_moments(&model->mode[j], length, way.x[j], way.v[j]);
        vi_mode_propagator(&model->mode[j], length, phi);
        level->of_rate[j][i] = phi[1];
        level->of_load[j][i] = way.x[j][0];
        level->of_ramp[j][i] = 0.5 * length * (way.x[j][0] + way.x[j][1]);
    }
    for (int k = 0; k < t->contacts; ++k) {
        if (t->press[k].kind == VI_PRESS_POWER) {
            make_contact(t, level, k, i, wave, &way);
        }
    }
    for (int r = t->contacts; r < t->rows; ++r) {
        make_point(t, level, r, i, wave, &way);
    }
    respond_to_wave(t, t->observed, wave, i, way.x, level->wave_seen);
}

static void make_end(const vi_power_tables *t, vi_power_level *level, const vi_structure_model *model)
{
    double wave[2][VI_NODES], x[VI_NODES], v[VI_NODES], phi[4];
    wave_series(t, level->step, wave);
    for (int j = 0; j < t->modes; ++j) {
        vi_moments(&model->mode[j], level->step, x, v);
        vi_mode_propagator(&model->mode[j], level->step, phi);
        level->of_rate_end[j] = phi[1];
        for (int n = 0; n < VI_NODES; ++n) {
            level->moment[n][j] = x[n];
            level->moment_rate[n][j] = v[n];
        }
        for (int c = 0; c < 2; ++c) {
            level->wave_end[c][j] = product(wave[c], x);
            level->wave_end_rate[c][j] = product(wave[c], v);
        }
        for (int k = 0; k < t->contacts; ++k) {
            const double natural = model->mode[j].natural, step = level->step;
            const double turn = natural * step > 1.0 ? 1.0 / natural : step;
            level->reach[k] += t->shape[k][j] * t->shape[k][j] * turn;
        }
    }
}

const vi_power_level *vi_power_level_of(vi_power_tables *t, const vi_structure_model *model, int level)
{
    vi_power_level *made = &t->level[level];
    if (made->step == 0.0) {
        memset(made, 0, sizeof *made);
        made->step = vi_power_step_of(model, level);
        for (int i = 0; i < VI_NODES; ++i) {
            make_node(t, made, model, i);
        }
        make_end(t, made, model);
    }
    return made;
}
