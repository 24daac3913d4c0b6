#!/usr/bin/env bash
# Makes the pictures of README and docs anew: of the shipped clip, and of the oak too if CLIPS names a folder that
# holds oak_release/video.mkv and outline.json (by default $ARBORCAM_CLIPS). ONLY=name makes one group: views, film, shapes,
# wind, grown, sketch, photo, markers, forest, points, terminal, page, sheets. The sheets (film, wood, traced branches, skeleton and model of each
# clip) go to out/;
# without CLIPS the second is of a film made anew, for which, and for `grown`, `photo` and `markers`, PYTHON (python3) needs numpy, scipy and opencv.
# WOOD names a built bench `wood`. Needs what scripts/apt-packages-test.txt lists, and `make build` first.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

arborcam=$PWD/target/release/arborcam
to=$PWD/docs/pictures
clips=${CLIPS:-${ARBORCAM_CLIPS:-}}
python=${PYTHON:-python3}
only=${ONLY:-}
largest=150000 # bytes of a picture
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

fail() {
    printf 'pictures: %s\n' "$*" >&2
    exit 1
}

for tool in ffmpeg tmux "$python"; do
    command -v "$tool" >/dev/null || fail "$tool is not installed; run scripts/setup.sh --tests"
done
"$python" -c 'import PIL' 2>/dev/null || fail "$python has no PIL; run scripts/setup.sh --tests"
[[ -x $arborcam ]] || fail "$arborcam is not there; run \`make build\` first"
mkdir -p "$to"

trees=(winter)
declare -A film=([winter]=recordings/sparse_winter.mkv) outline=([winter]=recordings/sparse_winter.outline.json)
if [[ -n $clips ]]; then
    film[oak]=$clips/oak_release/video.mkv outline[oak]=$clips/oak_release/outline.json
    [[ -r ${film[oak]} && -r ${outline[oak]} ]] || fail "$clips holds no oak_release/video.mkv with outline.json"
    trees+=(oak)
else
    echo "pictures: neither CLIPS nor ARBORCAM_CLIPS is given; those of the oak stay as they are"
fi

# Whether a group of pictures is wanted.
wanted() { [[ -z $only || $only == "$1" ]]; }

# Captures TREE once.
capture() {
    [[ -d $work/$1 ]] || "$arborcam" replay "${film[$1]}" --outline "${outline[$1]}" --fast --headless --out "$work/$1" \
        2>"$work/$1.log" || fail "the replay of ${film[$1]} failed: $(tail -n 1 "$work/$1.log")"
}

# render TREE FILE OPTIONS...
render() {
    local tree=$1 out=$2
    shift 2
    capture "$tree"
    rm -f "$out"
    "$arborcam" render "$work/$tree" --out "$out" "$@" 2>"$work/render.log" ||
        fail "render $* failed: $(cat "$work/render.log")"
}

# row FILE PICTURES...: side by side, with as many colours as the size allows.
row() {
    local out=$1 colours inputs=() n
    shift
    n=$#
    local stack="hstack=inputs=$n"
    ((n > 1)) || stack=copy
    for picture in "$@"; do inputs+=(-i "$picture"); done
    for colours in 256 96 48 24; do
        ffmpeg -v error -nostdin -y "${inputs[@]}" -filter_complex \
            "$stack,split[a][b];[a]palettegen=max_colors=$colours:reserve_transparent=0[p];[b][p]paletteuse=dither=none" \
            -frames:v 1 "$out"
        (($(stat -c %s "$out") <= largest)) && break
    done
    told "$out"
}

told() {
    local bytes
    bytes=$(stat -c %s "$1")
    ((bytes <= largest)) || fail "$1 has $bytes bytes, more than $largest"
    printf 'pictures: %-28s %4d kB\n' "${1#"$PWD/"}" $((bytes / 1000))
}

# The tree from front, side and top, leafless and in leaf.
views() {
    local tree
    for tree in "${trees[@]}"; do
        for view in front side top; do
            render "$tree" "$work/$tree-bare-$view.png" --view $view --size 320x320 --bare
            render "$tree" "$work/$tree-leaf-$view.png" --view $view --size 320x320
        done
        row "$to/$tree-bare.png" "$work/$tree"-bare-{front,side,top}.png
        # A tree that was filmed without leaves has none.
        if cmp -s "$work/$tree-bare-front.png" "$work/$tree-leaf-front.png"; then
            echo "pictures: $tree has no leaves"
        else
            row "$to/$tree-leaf.png" "$work/$tree"-leaf-{front,side,top}.png
        fi
    done
    render winter "$work/front.png" --size 480x500
    render winter "$work/side.png" --view side --size 480x500
    row "$to/model.png" "$work/front.png" "$work/side.png"
}

# The film beside the model in the same frame.
film_beside() {
    local tree quality
    for tree in "${trees[@]}"; do
        render "$tree" "$work/beside.png" --film beside
        for quality in 3 5 8; do
            ffmpeg -v error -nostdin -y -i "$work/beside.png" -q:v $quality -frames:v 1 "$to/$tree-film.jpg"
            (($(stat -c %s "$to/$tree-film.jpg") <= largest)) && break
        done
        told "$to/$tree-film.jpg"
    done
}

# One tree pushed into five shapes.
shapes() {
    local tree=winter shape
    [[ -n $clips ]] && tree=oak
    for shape in triangle circle pentagon heart vase; do
        render "$tree" "$work/shaped-$shape.png" --size 256x288 --envelope "docs/shapes/$shape.png" --leaves on
    done
    row "$to/topiary.png" "$work"/shaped-{triangle,circle,pentagon,heart,vase}.png
}

# grow NAME EXAMPLE OPTIONS...: trees like an example, which lies below $work too.
grow() {
    local name=$1 example=$2
    shift 2
    "$arborcam" grow "$work/$example" --motion none --out "$work/$name" "$@" 2>"$work/grow.log" ||
        fail "grow of $example failed: $(tail -n 1 "$work/grow.log")"
}

# A tree and new ones like it: of the same forks, and of the same branches at freer and freer angles, and from lower and
# lower levels on. The forks of both as points in triangles.
grown() {
    local threshold level tree
    capture winter
    grow offspring winter --count 8
    for threshold in 0.6 0.4 0.2; do
        grow "turned-$threshold" winter --count 1 --like von-mises --threshold "$threshold"
    done
    for level in 4 3 2; do
        grow "from-$level" winter --count 1 --like von-mises --from-level "$level"
    done
    for tree in winter offspring/tree-000{1..8} turned-{0.6,0.4,0.2}/tree-0001 from-{4,3,2}/tree-0001; do
        render_made "$tree"
    done
    row "$to/grown.png" "$work"/made-winter.png "$work"/made-offspring-tree-000{1..8}.png
    row "$to/turned.png" "$work"/made-winter.png "$work"/made-turned-{0.6,0.4,0.2}-tree-0001.png
    row "$to/turned-from.png" "$work"/made-winter.png "$work"/made-from-{4,3,2}-tree-0001.png
    "$python" scripts/pictures.py triangles "$work/winter" "$work/offspring" "$to/triangles.png"
    told "$to/triangles.png"
}

# Two sketches, what becomes of them, and what is grown of the first.
sketch() {
    local name tree
    for name in tree conifer; do
        "$arborcam" sketch "docs/sketches/$name.svg" --out "$work/drawn-$name" 2>"$work/sketch.log" ||
            fail "sketch of $name failed: $(tail -n 1 "$work/sketch.log")"
        "$python" scripts/pictures.py drawing "docs/sketches/$name.svg" 288 "$work/drawing-$name.png"
        render_made "drawn-$name"
        render_made "drawn-$name" side
    done
    grow from-sketch drawn-tree --count 3
    for tree in from-sketch/tree-000{1,2,3}; do
        render_made "$tree"
    done
    row "$to/sketch.png" "$work/drawing-tree.png" "$work"/made-drawn-tree{,-side}.png \
        "$work"/made-from-sketch-tree-000{1,2,3}.png
    row "$to/sketch-conifer.png" "$work/drawing-conifer.png" "$work"/made-drawn-conifer{,-side}.png
}

# A bare tree and one in leaf, each from a photograph with two strokes.
photo() {
    local seed look made
    for seed in 32005 32002; do
        look=bare
        ((seed % 2)) || look=leaves
        made=$work/photo-$seed
        "$python" benches/made_photos.py "$work" "photo-$seed" "$seed" "$look" ||
            fail "no photograph could be made; see the head of benches/made_photos.py for what PYTHON needs"
        "$arborcam" photo "$made/photo.jpg" --crown "$made/crown.json" --branch "$made/trunk.json" --out "$work/seen-$seed" \
            2>"$work/photo.log" || fail "photo of $seed failed: $(tail -n 1 "$work/photo.log")"
        "$python" scripts/pictures.py photo "$made" "$work/seen-$seed" 256 "$work/strokes-$seed.png"
        for view in front side; do
            "$arborcam" render "$work/seen-$seed" --size 256x256 --view "$view" --out "$work/seen-$seed-$view.png" \
                2>"$work/render.log" || fail "render of $seed failed: $(cat "$work/render.log")"
        done
        row "$to/photo-$look.png" "$work"/{strokes-$seed,seen-$seed-front,seen-$seed-side}.png
    done
}

# A made film with coloured markers, one of which a board hides for a second.
markers() {
    local film=$work/marked
    "$python" benches/made_films.py "$work" marked 46003 bare held --markers 10 --seconds 13.634 ||
        fail "no film with markers could be made; see the head of benches/made_films.py for what PYTHON needs"
    "$arborcam" replay "$film/video.mkv" --outline "$film/outline.json" --markers "$film/markers.json" --fast --headless \
        --out "$work/marked-tree" 2>"$work/marked.log" || fail "the replay with markers failed: $(tail -n 1 "$work/marked.log")"
    ffmpeg -v error -nostdin -y -i "$film/video.mkv" -vf "select='eq(n,0)+eq(n,132)'" -vsync 0 "$work/marked-%d.png"
    "$python" scripts/pictures.py markers "$film" "$work/marked-tree" "$work"/marked-{1,2}.png 132 "$to/markers.png"
    told "$to/markers.png"
}

# Forty trees of eight on a hill.
forest() {
    local tree=winter
    [[ -n $clips ]] && tree=oak
    capture "$tree"
    "$arborcam" grow "$work/$tree" --count 40 --forest --motion none --height-map docs/shapes/hills.png \
        --out "$work/forest" 2>"$work/grow.log" || fail "grow --forest failed: $(tail -n 1 "$work/grow.log")"
    "$arborcam" render "$work/forest" --view turntable --size 800x330 --out "$work/forest.png" 2>"$work/render.log" ||
        fail "render of the forest failed: $(cat "$work/render.log")"
    row "$to/forest.png" "$work/forest.png"
}

# render_made NAME [VIEW]: draws the tree in a folder below $work to made-NAME[-VIEW].png, slashes as dashes.
render_made() {
    "$arborcam" render "$work/$1" --bare --size 256x288 --view "${2:-front}" \
        --out "$work/made-${1//\//-}${2:+-$2}.png" 2>"$work/render.log" ||
        fail "render of $1 failed: $(cat "$work/render.log")"
}

# Still air, a breeze, a gale and a storm.
wind() {
    local tree force out
    for tree in "${trees[@]}"; do
        capture "$tree"
        for force in 0 4 7 10; do
            out=$work/$tree-wind-$force.png
            rm -f "$out"
            "$arborcam" animate "$work/$tree" --wind "$force" --seconds 3 --size 288x288 --out "$out" 2>"$work/animate.log" ||
                fail "animate --wind $force failed: $(tail -n 1 "$work/animate.log")"
        done
        row "$to/$tree-wind.png" "$work/$tree"-wind-{0,4,7,10}.png
    done
}

# What `cargo bench --bench wood` finds in the clip in folder $1, into folder $2.
find_wood() {
    if [[ -n ${WOOD:-} ]]; then
        "$WOOD" "$1" "$2"
    else
        cargo bench --locked --bench wood -- "$1" "$2"
    fi
}

# sheet NAME: of the clip in $work/clip-NAME.
sheet() {
    local name=$1 clip=$work/clip-$1 capture=$work/sheet-$1 view
    "$arborcam" replay "$clip/video.mkv" --outline "$clip/outline.json" --fast --headless --out "$capture" \
        2>"$capture.log" || fail "the replay of $name failed: $(tail -n 1 "$capture.log")"
    find_wood "$clip" "$work/wood-$name" >"$capture.wood" 2>&1 || fail "no wood of $name: $(tail -n 1 "$capture.wood")"
    for view in front side; do
        "$arborcam" render "$capture" --out "$work/sheet-$name-$view.png" --view $view --pose rest --size 640x360 \
            --background white 2>"$work/render.log" || fail "render --view $view failed: $(cat "$work/render.log")"
    done
    mkdir -p out
    "$python" scripts/pictures.py sheet "$work/wood-$name" "$capture" "$work/sheet-$name-front.png" \
        "$work/sheet-$name-side.png" "out/$name.png"
    printf 'pictures: out/%s.png, %s\n' "$name" "$(grep '^wood:' "$capture.wood" | tail -n 1)"
}

# Each clip on one sheet: is the tree in the model the tree in the film?
sheets() {
    local name
    if [[ -n $clips ]]; then
        for name in sparse_winter oak_release; do
            ln -s "$(realpath "$clips/$name")" "$work/clip-$name"
            sheet $name
        done
        return
    fi
    mkdir "$work/clip-sparse_winter"
    ln -s "$PWD/recordings/sparse_winter.mkv" "$work/clip-sparse_winter/video.mkv"
    ln -s "$PWD/recordings/sparse_winter.outline.json" "$work/clip-sparse_winter/outline.json"
    sheet sparse_winter
    "$python" benches/made_films.py "$work" clip-made_leaves 1 leaves release ||
        fail "no film could be made; see the head of benches/made_films.py for what PYTHON needs"
    sheet made_leaves
}

# A frame with outline and points, coloured by main branch.
points() {
    capture winter
    "$python" scripts/pictures.py points "$work/winter" "$to/frame.png"
    told "$to/frame.png"
}

# The screen of a running capture. A server of its own, lest it meets the user's sessions.
terminal() {
    local server=arborcam-pictures-$$ k
    tmux -L "$server" -f /dev/null new-session -d -x 120 -y 40 \
        "env TERM=tmux-256color COLORTERM=truecolor ARBORCAM_PREVIEW=halfblocks '$arborcam' replay '${film[winter]}' \
        --outline '${outline[winter]}' --out '$work/screen'; sleep 60"
    for ((k = 0; k < 60; k++)); do
        sleep 0.3
        tmux -L "$server" capture-pane -p | grep -q '±' && break
    done
    # Paused, so that the film does not end before the picture is taken.
    tmux -L "$server" send-keys Space m
    sleep 1
    tmux -L "$server" capture-pane -e -p >"$work/screen.txt"
    tmux -L "$server" kill-server
    "$python" scripts/pictures.py terminal "$work/screen.txt" "$to/terminal.png"
    told "$to/terminal.png"
}

# The page in a desktop's and a phone's browser.
page() {
    capture winter
    scripts/test-modules.sh >/dev/null
    "$arborcam" export "$work/winter" --format html --out "$work/page.html" 2>"$work/page.log" ||
        fail "the page was not written: $(cat "$work/page.log")"
    node scripts/pictures-viewer.mjs "$work/page.html" "$work/viewer.png" "$work/viewer-phone.png"
    row "$to/viewer.png" "$work/viewer.png"
    row "$to/viewer-phone.png" "$work/viewer-phone.png"
}

wanted views && views
wanted film && film_beside
wanted shapes && shapes
wanted wind && wind
wanted grown && grown
wanted sketch && sketch
wanted photo && photo
wanted markers && markers
wanted forest && forest
wanted points && points
wanted terminal && terminal
wanted page && page
wanted sheets && sheets
echo "pictures: $(du -ck "$to"/* | tail -n 1 | cut -f 1) kB in ${to#"$PWD/"}"
