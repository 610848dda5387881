"""Every node that a server shows in published namespaces, against their nodesets."""
import xml.etree.ElementTree as ElementTree

from asyncua import ua

SCHEMA = "{http://opcfoundation.org/UA/2011/03/UANodeSet.xsd}"
VALUES = "{http://opcfoundation.org/UA/2008/02/Types.xsd}"
CORE = "http://opcfoundation.org/UA/"
TYPE, RULE, SUBTYPE = 40, 37, 45


class Published:
    """Nodes of one nodeset, by their numbers. Names and identifiers carry the address of their namespace."""

    def __init__(self, file):
        root = ElementTree.parse(file).getroot()
        self.addresses = [CORE] + [one.text for one in root.find(SCHEMA + "NamespaceUris")]
        self.address = self.addresses[1]
        self.aliases = {one.get("Alias"): one.text for one in root.find(SCHEMA + "Aliases")}
        self.nodes = {self.identifier(one.get("NodeId")): one for one in root if one.tag.startswith(SCHEMA + "UA")}

    def identifier(self, text):
        text = self.aliases.get(text, text)
        index, number = text.split(";") if ";" in text else ("ns=0", text)
        return self.addresses[int(index[3:])], int(number.removeprefix("i="))

    def name(self, text):
        index, name = text.split(":", 1) if text[0].isdigit() else ("0", text)
        return self.addresses[int(index)], name

    def references(self, node, forward=True):
        found = {}
        for one in node.find(SCHEMA + "References"):
            if (one.get("IsForward") != "false") == forward:
                found.setdefault(self.identifier(one.get("ReferenceType"))[1], set()).add(self.identifier(one.text))
        return found

    def fields(self, node):
        """Name, type, rank, and whether it is optional or takes subtypes, of each field; of an enumeration name and value."""
        definition = node.find(SCHEMA + "Definition")
        if definition is None:
            return None
        fields = []
        for one in definition:
            if one.get("Value") is not None:
                fields.append((one.get("Name"), int(one.get("Value"))))
            else:
                marked = one.get("IsOptional") == "true" or one.get("AllowSubTypes") == "true"
                fields.append((one.get("Name"), self.identifier(one.get("DataType", "i=24")), int(one.get("ValueRank", -1)), marked))
        return fields

    def arguments(self, node):
        found = []
        for one in node.iter(VALUES + "Argument"):
            kind = one.find(VALUES + "DataType/" + VALUES + "Identifier").text
            found.append((one.find(VALUES + "Name").text, self.identifier(kind), int(one.find(VALUES + "ValueRank").text)))
        return found


async def attribute(node, which):
    return (await node.read_attribute(which)).Value.Value


class Shown:
    """The nodes of a server, as asyncua reads them."""

    def __init__(self, client, addresses):
        self.client, self.addresses = client, addresses

    def identifier(self, node):
        return self.addresses[node.NamespaceIndex], node.Identifier

    def fields(self, definition):
        if isinstance(definition, ua.EnumDefinition):
            return [(one.Name, one.Value) for one in definition.Fields]
        return [(one.Name, self.identifier(one.DataType), one.ValueRank, one.IsOptional) for one in definition.Fields]

    async def all(self):
        """Every node below the root, with its references."""
        begin = ua.NodeId(84)
        seen, waiting = {}, [begin]
        while waiting:
            now = waiting.pop()
            if now in seen:
                continue
            references = await self.client.get_node(now).get_references(ua.ObjectIds.References, ua.BrowseDirection.Both)
            seen[now] = references
            for one in references:
                if one.IsForward:
                    waiting.append(ua.NodeId(one.NodeId.Identifier, one.NodeId.NamespaceIndex))
        return seen


async def compare(client, files):
    """Compares; gives how many nodes were in each namespace."""
    addresses = await client.get_namespace_array()
    shown = Shown(client, addresses)
    nodes = await shown.all()
    counts = {}
    for file in files:
        published = Published(file)
        index = addresses.index(published.address)
        own = [one for one in nodes if one.NamespaceIndex == index]
        assert own, published.address
        counts[published.address] = len(own)
        for one in own:
            await same(shown, published, one, nodes[one])
    return counts


async def same(shown, published, identifier, references):
    expected = published.nodes.get(shown.identifier(identifier))
    assert expected is not None, f"{identifier} is not published in {published.address}"
    node = shown.client.get_node(identifier)
    told = f"{identifier} {expected.get('BrowseName')}"
    kind = (await node.read_node_class()).name
    assert "UA" + kind == expected.tag.removeprefix(SCHEMA), told
    name = await node.read_browse_name()
    assert (shown.addresses[name.NamespaceIndex], name.Name) == published.name(expected.get("BrowseName")), (told, name)
    display = expected.find(SCHEMA + "DisplayName").text
    assert (await node.read_display_name()).Text == display, told
    if kind in ("Variable", "VariableType"):
        assert shown.identifier(await node.read_data_type()) == published.identifier(expected.get("DataType", "i=24")), told
        assert await attribute(node, ua.AttributeIds.ValueRank) == int(expected.get("ValueRank", -1)), told
    if kind in ("ObjectType", "VariableType", "DataType"):
        assert await attribute(node, ua.AttributeIds.IsAbstract) == (expected.get("IsAbstract") == "true"), told
    fields = published.fields(expected)
    if fields is not None:
        assert shown.fields(await node.read_data_type_definition()) == fields, told
    arguments = published.arguments(expected)
    if arguments:
        value = await node.read_value()
        assert [(one.Name, shown.identifier(one.DataType), one.ValueRank) for one in value] == arguments, (told, value)
    if (number := expected.find(f"{SCHEMA}Value/{VALUES}UInt32")) is not None:
        assert await node.read_value() == int(number.text), told
    # Each reference of ours between published nodes is a published one, from the one or the other side; a type may be left incomplete.
    for one in references:
        kind_of = one.ReferenceTypeId.Identifier
        target = shown.addresses[one.NodeId.NamespaceIndex], one.NodeId.Identifier
        if one.ReferenceTypeId.NamespaceIndex or target[0] not in published.addresses:
            continue
        if target[0] == CORE and kind_of not in (TYPE, RULE, SUBTYPE):
            continue
        if target in published.references(expected, one.IsForward).get(kind_of, ()):
            continue
        other = published.nodes.get(target)
        back = published.references(other, not one.IsForward) if other is not None else {}
        assert shown.identifier(identifier) in back.get(kind_of, ()), (told, kind_of, one.IsForward, target)
    for wanted in (TYPE, RULE, SUBTYPE):
        forward = wanted != SUBTYPE
        ours = {shown.identifier(ua.NodeId(one.NodeId.Identifier, one.NodeId.NamespaceIndex)) for one in references
                if one.IsForward == forward and one.ReferenceTypeId.Identifier == wanted}
        assert ours == published.references(expected, forward).get(wanted, set()), (told, wanted, ours)
