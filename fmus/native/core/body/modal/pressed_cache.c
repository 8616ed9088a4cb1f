#include "body/modal/pressed_cache.h"

#include <math.h>
#include <string.h>

#include "body/modal/forces.h"
#include "body/modal/held.h"
#include "modes/pressed_modes.h"

/* Cost of finding modes, in evaluations of one mode: on one contact over modes^2, on all contacts over modes^3. */
enum { COST_OF_ONE = 8, COST_OF_ALL = 9 };

/* ---- the contacts of a rest ---- */

static bool is_linear(const vi_structure *s, int k)
{
    if (s->state->status[k] == VI_CONTACT_HELD) {
        return true;
    }
    if (s->state->status[k] != VI_CONTACT_YIELDING || s->state->leaving[k]) {
        return false;
    }
    const vi_contact_law *law = &s->contacts[k].law; /* refuses external laws: their force is not known over a rest */
    return vi_law_of(law->law)->press == VI_PRESS_LINEAR && law->stiffness > 0.0 && !vi_structure_is_kept(s, k);
}

int vi_pressed_contacts(const vi_structure *s, int32_t port[VI_PORTS])
{
    int count = 0;
    for (int k = 0; k < s->model->contacts; ++k) {
        if (s->state->status[k] == VI_CONTACT_FREE) {
            continue;
        }
        if (!is_linear(s, k)) {
            return 0;
        }
        port[count++] = k;
    }
    return count;
}

static void describe(const vi_structure *s, const int32_t port[], int contacts, vi_pressed_body *body)
{
    const vi_structure_model *model = s->model;
    body->modes = vi_structure_modes(model);
    body->contacts = contacts;
    body->coupled = model->coupled && vi_structure_modes(model) > 1;
    for (int j = 0; j < vi_structure_modes(model); ++j) {
        body->square[j] = model->mode[j].stiffness;
        body->decay[j] = 0.5 * vi_structure_damping(model, j, j);
        if (body->coupled) {
            memcpy(body->coupling[j], model->coupling[j], (size_t)vi_structure_modes(model) * sizeof body->coupling[j][0]);
        }
    }
    for (int i = 0; i < contacts; ++i) {
        const int k = port[i];
        const vi_press press = vi_structure_press(s, k);
        body->held[i] = press.kind == VI_PRESS_HOLD;
        body->stiffness[i] = press.stiffness;
        body->damping[i] = press.damping;
        for (int j = 0; j < vi_structure_modes(model); ++j) {
            body->shape[i][j] = vi_structure_direction(s, k) * model->shape[k][j];
        }
    }
}

/* ---- modes, kept ---- */

static bool same_body(const vi_pressed_body *a, const vi_pressed_body *b)
{
    const size_t size = (size_t)a->modes * sizeof(double);
    bool same = a->modes == b->modes && a->contacts == b->contacts && a->coupled == b->coupled
                && memcmp(a->square, b->square, size) == 0 && memcmp(a->decay, b->decay, size) == 0;
    for (int i = 0; i < a->contacts && same; ++i) {
        same = a->held[i] == b->held[i] && a->stiffness[i] == b->stiffness[i] && a->damping[i] == b->damping[i]
               && memcmp(a->shape[i], b->shape[i], size) == 0;
    }
    for (int j = 0; j < a->modes && same && a->coupled; ++j) {
        same = memcmp(a->coupling[j], b->coupling[j], size) == 0;
    }
    return same;
}

/* Are the kept modes of these contacts those of the body, seen from the same points? */
static bool rests_as(const vi_pressed *pressed, const vi_structure_model *model, const vi_pressed_body *body)
{
    const size_t size = (size_t)vi_structure_modes(model) * sizeof(double);
    bool same = pressed->contacts == model->contacts && pressed->rows == model->rows && same_body(body, &pressed->body)
                && memcmp(pressed->observed, model->observed, size) == 0;
    for (int l = 0; l < model->rows && same; ++l) {
        same = memcmp(pressed->shape[l], model->shape[l], size) == 0;
    }
    return same;
}

static void weigh(const vi_pressed_modes *modes, const double shape[], vi_complex weight[])
{
    for (int m = 0; m < modes->terms; ++m) {
        weight[m] = (vi_complex){0.0, 0.0};
        for (int j = 0; j < modes->modes; ++j) {
            weight[m].re += shape[j] * modes->vector[m][j].re;
            weight[m].im += shape[j] * modes->vector[m][j].im;
        }
    }
}

static void weigh_all(vi_pressed *pressed, const vi_structure_model *model)
{
    for (int l = 0; l < model->rows; ++l) {
        weigh(&pressed->modes, model->shape[l], pressed->weight[l]);
    }
    weigh(&pressed->modes, model->observed, pressed->weight[VI_SEEN_OBSERVED]);
    for (int i = 0; i < pressed->body.contacts; ++i) {
        for (int m = 0; m < pressed->modes.terms; ++m) {
            pressed->weight[VI_SEEN_FORCE + i][m] = pressed->modes.force[m][i];
        }
    }
}

/* Find the equations of the response to the forcing, unless they are known at its present frequency. */
static void know_harmonic(vi_pressed *pressed, double angular_frequency)
{
    vi_coupled_equations *harmonic = &pressed->harmonic;
    if (pressed->known == VI_MODES_OF_ALL && !(harmonic->known && harmonic->s.im == angular_frequency)) {
        vi_coupled_equations_find(harmonic, &pressed->body, (vi_complex){0.0, angular_frequency});
    }
}

static void begin(vi_pressed_cache *cache, vi_pressed *pressed, const vi_structure_model *model, const int32_t port[])
{
    const vi_pressed_body *body = &cache->present;
    pressed->known = VI_MODES_NOT_FOUND;
    pressed->searched = 0;
    pressed->still.known = pressed->harmonic.known = 0;
    pressed->contacts = model->contacts;
    pressed->rows = model->rows;
    pressed->body = *body;
    memcpy(pressed->port, port, sizeof pressed->port);
    memcpy(pressed->shape, model->shape, sizeof pressed->shape);
    memcpy(pressed->observed, model->observed, sizeof pressed->observed);
    const bool one = body->contacts == 1 && !body->coupled;
    cache->spent += one ? (int64_t)COST_OF_ONE * body->modes * body->modes : 0;
    if (one && vi_pressed_modes_find(&pressed->modes, body)) {
        pressed->known = VI_MODES_OF_ONE;
        weigh_all(pressed, model);
    }
}

/* Place of the set of the present contacts; a new set takes the place of the set used longest ago. Modes that follow the
 * amplitude are never met again: all of their sets share one place. */
static int place_of(vi_pressed_cache *cache, const vi_structure_model *model, const int32_t port[])
{
    uint64_t stops = 0;
    int oldest = 0;
    for (int i = 0; i < cache->present.contacts; ++i) {
        stops |= (uint64_t)1 << port[i];
    }
    for (int i = 0; i < VI_PRESSED_SETS; ++i) {
        if (cache->stops[i] == stops && rests_as(&cache->set[i], model, &cache->present)) {
            return i;
        }
        oldest = cache->used[i] < cache->used[oldest] ? i : oldest;
    }
    const int place = model->varies ? 0 : oldest;
    cache->stops[place] = stops;
    begin(cache, &cache->set[place], model, port);
    return place;
}

const vi_pressed *vi_pressed_find(const vi_structure *s, bool all)
{
    vi_pressed_cache *cache = s->pressed;
    int32_t port[VI_PORTS] = {0};
    const int contacts = vi_pressed_contacts(s, port);
    describe(s, port, contacts, &cache->present);
    const int place = place_of(cache, s->model, port);
    vi_pressed *pressed = &cache->set[place];
    cache->used[place] = ++cache->searches;
    if (pressed->known == VI_MODES_NOT_FOUND && all && !pressed->searched) {
        const int64_t modes = pressed->body.modes;
        pressed->searched = 1;
        cache->spent += COST_OF_ALL * modes * modes * modes;
        if (vi_coupled_modes_find(&pressed->modes, &pressed->body, &cache->work)) {
            pressed->known = VI_MODES_OF_ALL;
            vi_coupled_equations_find(&pressed->still, &pressed->body, (vi_complex){0.0, 0.0});
            weigh_all(pressed, s->model);
        }
    }
    if (pressed->known == VI_MODES_NOT_FOUND || (pressed->known == VI_MODES_OF_ALL && !all)) {
        return NULL;
    }
    know_harmonic(pressed, s->model->clock.angular_frequency);
    return pressed;
}
