#include "body/modal/structure/jam.h"

#include <math.h>
#include <string.h>

#include "body/landing.h"
#include "body/modal/forces.h"
#include "body/modal/stop_motion.h"
#include "contact/complementarity.h"

/* Compliance added to each contact, relative to the largest. Each turn of the iteration reduces what is no force of
 * equilibrium by about this factor. */
static const double SOFTENING = 1e-6;
enum { TURNS = 3 };
/* Acceleration by forces in equilibrium, and share of a contact in them, that count as none. */
static const double NO_MOTION = 1e-9, NO_SHARE = 1e-9;
/* Clearance, relative to the displacements, that explains a motion whose time stands still. */
static const double LITTLE_ROOM = 1e-6;

/* The rigid contacts that touch their stops, and their compliances towards the stops. */
typedef struct {
    int index[VI_PORTS], count;
    double g[VI_PORTS][VI_PORTS], soft[VI_PORTS][VI_PORTS];
} touching_contacts;

/* Find them. False where they cannot jam: there are too few, or no stop of them moves. */
static bool touch(const vi_structure *s, double least, touching_contacts *touching)
{
    bool moves = false;
    touching->count = 0;
    for (int k = 0; k < s->model->contacts; ++k) {
        if (s->model->stop[k] == VI_RIGID_STOP
            && vi_structure_clearance(s, k) <= least * vi_structure_displacement_size(s, k)) {
            touching->index[touching->count++] = k;
            moves = moves || vi_structure_stop_moves(s->model, k);
        }
    }
    return moves && touching->count > 1;
}

static void find_compliances(const vi_structure *s, touching_contacts *touching)
{
    double whole[VI_PORTS][VI_PORTS], largest = 0.0;
    vi_structure_signed(s, s->model->compliance, whole);
    for (int i = 0; i < touching->count; ++i) {
        for (int j = 0; j < touching->count; ++j) {
            touching->g[i][j] = touching->soft[i][j] = whole[touching->index[i]][touching->index[j]];
        }
        largest = vi_max(largest, touching->g[i][i]);
    }
    for (int i = 0; i < touching->count; ++i) {
        touching->soft[i][i] += SOFTENING * largest;
    }
}

/* Find forces of the stops that push, and move nothing, by inverse iteration from the forces that lift all contacts of a
 * softened body. False where there are none. */
static bool balance(const touching_contacts *touching, double force[VI_PORTS])
{
    const int n = touching->count;
    double away[VI_PORTS] = {0.0}, soft[VI_PORTS][VI_PORTS];
    int pushes[VI_PORTS] = {0};
    memcpy(soft, touching->soft, sizeof soft);
    for (int i = 0; i < n; ++i) {
        away[i] = sqrt(touching->g[i][i]);
    }
    vi_complementary(n, soft, away, force);
    for (int turn = 0; turn < TURNS; ++turn) {
        double largest = 0.0;
        for (int i = 0; i < n; ++i) {
            largest = vi_max(largest, fabs(force[i]));
        }
        for (int i = 0; i < n; ++i) {
            pushes[i] = force[i] > NO_SHARE * largest;
            away[i] = pushes[i] ? force[i] / largest : 0.0;
        }
        if (!(largest > 0.0)) {
            return false;
        }
        vi_solve_active(n, soft, away, pushes, force);
    }
    for (int i = 0; i < n; ++i) {
        double motion = 0.0, size = 0.0;
        for (int j = 0; j < n; ++j) {
            motion += touching->g[i][j] * force[j];
            size += fabs(touching->g[i][j] * force[j]);
        }
        if (force[i] < 0.0 || fabs(motion) > NO_MOTION * size) {
            return false;
        }
    }
    return true;
}

bool vi_structure_jams(const vi_structure *s, double least, int jammed[VI_PORTS])
{
    if (!vi_structure_stops_move(s->model)) {
        return false;
    }
    double force[VI_PORTS] = {0.0}, closing = 0.0, size = 0.0;
    touching_contacts touching;
    bool moves = false;
    if (!touch(s, least, &touching)) {
        return false;
    }
    find_compliances(s, &touching);
    if (!balance(&touching, force)) {
        return false;
    }
    memset(jammed, 0, VI_PORTS * sizeof *jammed);
    for (int i = 0; i < touching.count; ++i) {
        const int k = touching.index[i];
        jammed[k] = force[i] > 0.0;
        moves = moves || (jammed[k] && vi_structure_stop_moves(s->model, k));
        closing += force[i] * vi_structure_approach(s, k); /* without the speeds of the bodies, which balance */
        size += force[i] * vi_structure_velocity_size(s, k);
    }
    return moves && closing >= -VI_ROUNDING * size;
}

bool vi_structure_jam_complains(const vi_structure *s, char message[VI_MESSAGE_LENGTH])
{
    int jammed[VI_PORTS];
    if (!vi_structure_jams(s, LITTLE_ROOM, jammed)) {
        return false;
    }
    vi_complain_of_jam(message, vi_clock_time(&s->model->clock, s->state->now), jammed, s->model->contacts);
    return true;
}
